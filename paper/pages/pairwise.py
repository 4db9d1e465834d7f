# SPDX-License-Identifier: Apache-2.0
"""Rules against networks on the same samples: who is right where the other is wrong, by what a sample shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from doorstate.evaluation.metrics import confusion_matrix, scores
from doorstate.evaluation.results import ComparisonResults
from doorstate.evaluation.table import Table, number
from doorstate.types import STATES

Row = Mapping[str, str]
# Semi-open doors are open by 15 to 65 degrees in this data set, open ones by 75 to 115 (docs/data-card.md).
BORDER_DEG, NEAR_DEG = (15.0, 65.0, 75.0), 5.0
NEARBY_M = 2.0
FEW_PIXELS = 10_000  # of the leaf, of the 307,200 of an image
ASIDE_DEG = 45.0  # from the ends of the half-ring, where the wall is seen along its face


def near_the_border(row: Row) -> bool:
    """Whether the opening angle is close to that of another state."""
    return min(abs(float(row["opening_angle_deg"]) - border) for border in BORDER_DEG) <= NEAR_DEG


def _aside(row: Row) -> bool:
    return abs(float(row["robot_angle_deg"]) - 90) > 90 - ASIDE_DEG


CASES: dict[str, Callable[[Row], bool]] = {
    "all": lambda row: True,
    **{state: lambda row, state=state: row["state"] == state for state in STATES},  # type: ignore[misc]
    f"opening within {NEAR_DEG:.0f}° of another state": near_the_border,
    f"from nearer than {NEARBY_M:.0f} m": lambda row: float(row["distance_m"]) < NEARBY_M,
    f"from within {ASIDE_DEG:.0f}° of the wall": _aside,
    f"leaf below {FEW_PIXELS} pixels": lambda row: float(row["visible_leaf_px"]) < FEW_PIXELS,
}


def cases_table(
    results: ComparisonResults,
    rows: Mapping[str, Row],
    methods: Sequence[str],
    cases: Mapping[str, Callable[[Row], bool]] = CASES,
) -> Table:
    """Accuracy of methods on cases that may be hard; they overlap, and one without samples is left out."""
    right = {method: results.pooled(method).right_by_sample for method in methods}
    lines = []
    for case, belongs in cases.items():
        chosen = [sample for sample in right[methods[0]] if belongs(rows[sample])]
        if not chosen:
            continue
        shares = (float(np.mean([right[method][sample] for sample in chosen])) for method in methods)
        lines.append((case, str(len(chosen)), *(number(share) for share in shares)))
    return Table(
        "Accuracy by what the sample is",
        ("samples", "number", *methods),
        tuple(lines),
        "No answer counts as wrong.",
    )


def duels_table(results: ComparisonResults, rules: Sequence[str], networks: Sequence[str]) -> Table:
    """How many samples one of a pair has right and the other wrong."""
    right = {network: results.pooled(network).right_by_sample for network in networks}
    lines = []
    for rule in rules:
        by_rule = results.pooled(rule)
        answered = dict(zip(by_rule.sample_ids, by_rule.predicted < len(STATES), strict=True))
        rule_right = by_rule.right_by_sample
        for network, network_right in right.items():
            only_network = [s for s, right in rule_right.items() if network_right[s] and not right]
            only_rule = sum(right and not network_right[s] for s, right in rule_right.items())
            silent = sum(not answered[sample] for sample in only_network)
            lines.append((rule, network, str(only_rule), str(len(only_network)), str(silent)))
    columns = (
        "rule",
        "network",
        "only the rule is right",
        "only the network is right",
        "there, the rule is silent",
    )
    return Table("Rules against networks", columns, tuple(lines), text_columns=2)


def never_seen_table(results: ComparisonResults, by_pose: ComparisonResults, rules: Sequence[str]) -> Table:
    """Macro-F1 of rules and networks on what networks were tested on without having seen its surroundings."""
    pools = {network: by_pose.pooled(network) for network in by_pose.networks}
    tested = set.intersection(*(set(pool.sample_ids) for pool in pools.values()))
    pools |= {rule: results.pooled(rule) for rule in rules}
    lines = []
    for method, pool in pools.items():
        chosen = np.array([sample in tested for sample in pool.sample_ids])
        true, predicted = pool.true[chosen], pool.predicted[chosen]
        macro_f1 = float(scores(confusion_matrix(true, predicted)).macro.f1)
        lines.append((method, number(macro_f1), f"{int((true != predicted).sum())} of {len(true)}"))
    return Table(
        "From places that no network has learned from", ("method", "macro F1", "errors"), tuple(lines)
    )
