# SPDX-License-Identifier: Apache-2.0
"""Tested samples by the places trained around them: between two trained directions, or beyond them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from doorstate.evaluation.results import Results

from .cases import Case

RING_M = 0.25  # trained places within this distance from that of a tested one count as beside it
MIDDLE_M = 2.5  # of the half-ring, 1.5 to 3.5 m


def place_cases(results: Results) -> Mapping[str, Case]:
    """Return cases for `accuracy_by_case`: between or beyond trained directions, near or far.

    Args:
        results: every sample is tested in at most one fold.
    """
    inside = samples_between(results)

    def case(is_between: bool, is_near: bool) -> Case:
        def belongs(rows: pd.DataFrame) -> pd.Series[bool]:
            between, near = rows["sample_id"].isin(inside), rows["distance_m"] < MIDDLE_M
            return (between == is_between) & (near == is_near)

        return belongs

    return {
        f"{words}, {side} {MIDDLE_M:g} m": case(is_between, is_near)
        for is_between, words in ((True, "between trained directions"), (False, "beyond them"))
        for is_near, side in ((True, "nearer than"), (False, "from"))
    }


def samples_between(results: Results) -> set[str]:
    """Return the tested samples with trained ones on both sides along the half-ring, at about the same distance."""
    places = results.manifest[["robot_angle_deg", "distance_m"]]
    samples: set[str] = set()
    for roles in results.splits:
        role = pd.Series(roles, dtype="str").reindex(places.index)
        trained = places[role == "train"].to_numpy()
        for sample, (bearing_deg, distance_m) in zip(
            places.index[role == "test"], places[role == "test"].to_numpy(), strict=True
        ):
            beside = trained[np.abs(trained[:, 1] - distance_m) <= RING_M, 0]
            if (beside < bearing_deg).any() and (beside > bearing_deg).any():
                samples.add(str(sample))
    return samples
