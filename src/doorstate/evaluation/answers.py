# SPDX-License-Identifier: Apache-2.0
"""Answers of weights that abstain, by kind of door, sensor, distance, tilt and occlusion, and reasons of the rest."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from doorstate.evaluation.manifest import number_values, text_values
from doorstate.evaluation.strata import ALL

_Strata = Callable[[pd.DataFrame], "pd.Series[str]"]


def _ranges(values: pd.Series[float], edges: tuple[float, ...], unit: str) -> pd.Series[str]:
    """Return the range of each value as text, ordered from low to high; missing where the value is."""
    between = [f"{low:g} to {high:g}{unit}" for low, high in pairwise(edges)]
    names = pd.Index([f"below {edges[0]:g}{unit}", *between, f"from {edges[-1]:g}{unit}"])
    places = np.searchsorted(edges, values.to_numpy(dtype=np.float64), side="right")
    places[values.isna()] = -1
    return pd.Series(pd.Categorical.from_codes(places, names), index=values.index)


def _tilt_deg(rows: pd.DataFrame) -> pd.Series[float]:
    """Return the angle between the camera's vertical and gravity."""
    pitch, roll = (np.radians(number_values(rows, name)) for name in ("pitch_deg", "roll_deg"))
    tilt: pd.Series[float] = np.degrees(np.arccos(np.clip(np.cos(pitch) * np.cos(roll), -1, 1)))
    return tilt


STRATA: dict[str, _Strata] = {
    "kind": lambda rows: text_values(rows, "door_kind"),
    "sensor": lambda rows: text_values(rows, "sensor"),
    "distance": lambda rows: _ranges(number_values(rows, "distance_m"), (1.5, 2.5, 3.5), " m"),
    "tilt": lambda rows: _ranges(_tilt_deg(rows), (3.0, 6.0, 12.0, 24.0), "°"),
    "occluded": lambda rows: _ranges(100 * number_values(rows, "occluded_share"), (1.0, 25.0, 50.0), " %"),
}
"""Strata of samples: a name, and the value of each row, missing or "" where the manifest does not record it."""


def count_answers(
    tested: pd.DataFrame, is_sure: NDArray[np.bool_], is_likely_door: NDArray[np.bool_]
) -> pd.DataFrame:
    """Count the answers for doors in every stratum, first for all doors.

    Args:
        tested: M rows of `Results.joined` with a state.
        is_sure: (M,) True where the predicted state is probable enough.
        is_likely_door: (M,) True where a door is likely enough.

    Returns:
        Columns factor, stratum, doors, answered, right, wrong, unsure, no_door. A door that is neither likely nor of a
        sure state counts as no door.
    """
    answered, correct = is_sure & is_likely_door, tested["correct"].to_numpy(dtype=bool)
    counted = pd.DataFrame(
        {
            "doors": 1,
            "answered": answered,
            "right": answered & correct,
            "wrong": answered & ~correct,
            "unsure": is_likely_door & ~is_sure,
            "no_door": ~is_likely_door,
        },
        index=tested.index,
    ).astype("int64")
    rows: list[dict[str, object]] = [{"factor": ALL, "stratum": "", **counted.sum()}]
    for factor, strata_of in STRATA.items():
        strata = strata_of(tested)
        for stratum, own in counted.groupby(strata[strata.notna() & (strata != "")], observed=True):
            rows.append({"factor": factor, "stratum": str(stratum), **own.sum()})
    return pd.DataFrame(rows)
