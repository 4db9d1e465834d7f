# SPDX-License-Identifier: Apache-2.0
"""Tested samples by the places trained around them."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd
from paper.pages.places import place_cases

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.predictions import load_results
from tests.evaluation.conftest import MakeComparison


def test_a_place_is_between_trained_directions_or_beyond_them(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    results = load_results(make_comparison(simulated, protocol="by-pose"))
    roles = {"close left": "train", "left": "test", "far right": "train", "middle": "train"}

    def cases_of_left(middle_m: float) -> list[str]:
        places = {
            "close left": (20, 1.6),
            "left": (40, 1.6),
            "far right": (150, 3.0),
            "middle": (90, middle_m),
        }
        manifest = pd.DataFrame(places, index=["robot_angle_deg", "distance_m"]).T
        rows = manifest.loc[["left"]].assign(sample_id="left")
        cases = place_cases(replace(results, splits=(roles,), manifest=manifest))
        return [case for case, belongs in cases.items() if belongs(rows).all()]

    assert cases_of_left(2.0) == ["beyond them, nearer than 2.5 m"]
    assert cases_of_left(1.8) == ["between trained directions, nearer than 2.5 m"]
