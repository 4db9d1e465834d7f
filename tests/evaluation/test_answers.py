# SPDX-License-Identifier: Apache-2.0
"""Counts of answers by stratum against a loop over the rows."""

from __future__ import annotations

import numpy as np
import pandas as pd

from doorstate.evaluation.answers import count_answers

ROWS = pd.DataFrame(
    {
        "correct": [True, False, True, True, False, True],
        "door_kind": ["single", "single", "sliding", "sliding", "single", None],
        "distance_m": [1.0, 1.5, 2.0, 5.0, 3.5, np.nan],
        "pitch_deg": [0.0, 4.0, 0.0, 30.0, -10.0, 2.0],
        "roll_deg": [0.0, 3.0, -2.0, 0.0, 0.0, 2.0],
        "occluded_share": [0.0, 0.1, 0.3, 0.9, 0.005, 0.0],
    }
)
SURE = np.array([True, True, False, True, True, False])
DOOR = np.array([True, True, True, True, False, False])


def test_counts_are_those_of_a_loop() -> None:
    counts = count_answers(ROWS, SURE, DOOR).set_index(["factor", "stratum"])
    assert counts.loc[("all", "")].tolist() == [6, 3, 2, 1, 1, 2]
    assert counts.loc[("kind", "single")].tolist() == [3, 2, 1, 1, 0, 1]
    assert counts.loc[("kind", "sliding")].tolist() == [2, 1, 1, 0, 1, 0]
    assert (counts["answered"] == counts["right"] + counts["wrong"]).all()
    assert (counts["doors"] == counts["answered"] + counts["unsure"] + counts["no_door"]).all()


def test_ranges_are_ordered_and_take_their_lower_edge() -> None:
    counts = count_answers(ROWS, SURE, DOOR)
    doors = {
        factor: dict(zip(rows["stratum"], rows["doors"], strict=True))
        for factor, rows in counts.groupby("factor", sort=False)
    }
    assert list(doors) == ["all", "kind", "distance", "tilt", "occluded"], "no sensor is recorded"
    assert list(doors["distance"].items()) == [
        ("below 1.5 m", 1),
        ("1.5 to 2.5 m", 2),
        ("from 3.5 m", 2),
    ]
    # A pitch of 4 and a roll of 3 degrees are a tilt of 5.
    assert doors["tilt"] == {"below 3°": 3, "3 to 6°": 1, "6 to 12°": 1, "from 24°": 1}
    assert doors["occluded"] == {"below 1 %": 3, "1 to 25 %": 1, "25 to 50 %": 1, "from 50 %": 1}
