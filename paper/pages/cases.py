# SPDX-License-Identifier: Apache-2.0
"""Accuracy of methods by properties of the sample, and samples that only one of two methods gets right."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pandas as pd

from doorstate.evaluation.pairwise import correct_by_method
from doorstate.evaluation.results import Results
from doorstate.types import ABSTAINED

Case = Callable[[pd.DataFrame], "pd.Series[bool]"]
"""Return for each row of `Results.tested` whether it belongs to a case."""

BORDERS_DEG = (15.0, 65.0, 75.0)  # semi-open 15 to 65 degrees, open 75 to 115 (docs/data-card.md)
NEAR_BORDER_DEG = 5.0
NEAR_M = 2.0
FEW_LEAF_PX = 10_000  # of the 307,200 pixels of an image
FEW_MEASURED_PX = 150_000
FROM_WALL_DEG = 45.0


def near_border(rows: pd.DataFrame) -> pd.Series[bool]:
    """Return for each row whether its opening angle is within 5 degrees of the range of another state."""
    distance = np.abs(rows["opening_angle_deg"].to_numpy()[:, None] - np.array(BORDERS_DEG)).min(axis=1)
    return pd.Series(distance <= NEAR_BORDER_DEG, rows.index)


PAPER_CASES: Mapping[str, Case] = {
    "all": lambda rows: rows["state"].notna(),
    "closed": lambda rows: rows["state"] == "closed",
    "semi-open": lambda rows: rows["state"] == "semi_open",
    "open": lambda rows: rows["state"] == "open",
    f"opening within {NEAR_BORDER_DEG:.0f}° of another state": near_border,
    f"nearer than {NEAR_M:.0f} m": lambda rows: rows["distance_m"] < NEAR_M,
    f"within {FROM_WALL_DEG:.0f}° of the wall": lambda rows: (
        (rows["robot_angle_deg"] - 90).abs() > 90 - FROM_WALL_DEG
    ),
    f"fewer than {FEW_LEAF_PX} pixels of the leaf": lambda rows: rows["visible_leaf_px"] < FEW_LEAF_PX,
}
MIXTURE_CASES: Mapping[str, Case] = {
    "all doors": lambda rows: rows["state"].notna(),
    "single leaf": lambda rows: rows["door_kind"] == "single",
    "leaf with a window": lambda rows: rows["door_kind"] == "glazed",
    "leaf of glass": lambda rows: rows["door_kind"] == "full_glass",
    "sliding": lambda rows: rows["door_kind"] == "sliding",
    "two leaves": lambda rows: rows["door_kind"].str.startswith("double"),
    "a quarter hidden, or more": lambda rows: rows["occluded_share"] >= 0.25,
    f"fewer than {FEW_LEAF_PX} pixels of the leaf": lambda rows: rows["visible_leaf_px"] < FEW_LEAF_PX,
    f"fewer than {FEW_MEASURED_PX} measured pixels": lambda rows: rows["measured_px"] < FEW_MEASURED_PX,
    f"nearer than {NEAR_M:.0f} m": lambda rows: rows["distance_m"] < NEAR_M,
}


def accuracy_by_case(results: Results, methods: Sequence[str], cases: Mapping[str, Case]) -> pd.DataFrame:
    """Return accuracy by case, which may overlap; an abstention counts as wrong, and empty cases are left out.

    Returns:
        Columns case, samples and one a method.
    """
    rows = []
    for case, belongs in cases.items():
        correct = {}
        for method in methods:
            tested = results.tested_by(method)
            correct[method] = tested.loc[belongs(tested), "correct"]
        samples = len(correct[methods[0]])
        if samples:
            rows.append(
                {"case": case, "samples": samples} | {name: part.mean() for name, part in correct.items()}
            )
    return pd.DataFrame(rows, columns=["case", "samples", *methods])


def compare_with_rule(results: Results, rule: str, networks: Sequence[str]) -> pd.DataFrame:
    """Count the samples that only a rule or only a network gets right.

    Returns:
        Columns method, only_rule, only_network, and abstained: those of `only_network` where the rule abstained.
    """
    correct = correct_by_method(results)
    by_rule = results.tested_by(rule).set_index("sample_id")
    abstained = (by_rule["predicted"] == ABSTAINED).reindex(correct.index)
    rule_correct = correct[rule].astype(bool)
    rows = []
    for network in networks:
        network_correct = correct[network].astype(bool)
        only_network = network_correct & ~rule_correct
        only_rule = int((rule_correct & ~network_correct).sum())
        rows.append((network, only_rule, int(only_network.sum()), int((only_network & abstained).sum())))
    return pd.DataFrame(rows, columns=["method", "only_rule", "only_network", "abstained"])


def count_error_kinds(results: Results) -> tuple[int, int, int]:
    """Return the errors of all methods, those near the range of another state, and of the others those from nearby."""
    errors = results.errors
    far = errors[~near_border(errors)]
    return len(errors), len(errors) - len(far), int((far["distance_m"] < NEAR_M).sum())
