# SPDX-License-Identifier: Apache-2.0
"""Where a protocol asks for more than what lies between learned places: tested samples by what is learned around."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from doorstate.evaluation.results import ComparisonResults

Row = Mapping[str, str]
_SIDE_M = 0.25  # learned places so much nearer or farther from the door count as beside a tested one
_MIDDLE_M = 2.5  # of the half-ring, 1.5 to 3.5 m


def places_cases(results: ComparisonResults, rows: Mapping[str, Row]) -> dict[str, Callable[[Row], bool]]:
    """Cases for `cases_table`: with learned places on both sides along the half-ring, or on one side alone.

    Args:
        results: every sample is tested by one fold at most.
        rows: of the manifest, by sample.
    """
    between = {sample for fold in range(len(results.splits)) for sample in _between(results, rows, fold)}

    def case(inside: bool, near: bool) -> Callable[[Row], bool]:
        return lambda row: (
            (row["sample_id"] in between) is inside and (float(row["distance_m"]) < _MIDDLE_M) is near
        )

    return {
        f"{words}, {side} {_MIDDLE_M:g} m": case(inside, near)
        for inside, words in ((True, "between learned directions"), (False, "beyond them"))
        for near, side in ((True, "nearer than"), (False, "from"))
    }


def _between(results: ComparisonResults, rows: Mapping[str, Row], fold: int) -> list[str]:
    learned = np.array(
        [_place(rows[sample]) for sample, role in results.splits[fold].items() if role == "train"]
    )
    found = []
    for sample, role in results.splits[fold].items():
        if role != "test":
            continue
        bearing_deg, distance_m = _place(rows[sample])
        beside = learned[np.abs(learned[:, 1] - distance_m) <= _SIDE_M, 0]
        if (beside < bearing_deg).any() and (beside > bearing_deg).any():
            found.append(sample)
    return found


def _place(row: Row) -> np.ndarray:
    return np.array([float(row["robot_angle_deg"]), float(row["distance_m"])])
