# SPDX-License-Identifier: Apache-2.0
"""Values of docs/related.md: rules and a multi-view network beside the five networks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from doorstate.evaluation.method_scores import summarize_methods
from doorstate.evaluation.results import Results
from doorstate.evaluation.rule_outputs import score_angles
from doorstate.evaluation.strata import ALL
from doorstate.evaluation.table import Table, count_column, interval_column, number_column
from doorstate.types import ABSTAINED

from ..paths import TITLES
from ..published import comparison, side_by_side
from .cases import PAPER_CASES, accuracy_by_case, compare_with_rule
from .results import case_columns, method_column


def content() -> Mapping[str, Any]:
    """Return the values of the page."""
    results, by_pose = side_by_side("related"), comparison("by-pose")
    summary = related_summary(results, by_pose)
    rules = [name for name in results.rules if (results.tested_by(name)["predicted"] == "semi_open").any()]
    by_name = summary.set_index("method")
    f1 = dict(zip(summary["method"], summary["f1"], strict=True))
    best_rule, best_network = max(rules, key=f1.__getitem__), max(results.networks, key=f1.__getitem__)
    ahead = [name for name in results.networks if f1[name] < f1[best_rule]]
    columns = [name for name in (*rules, best_network) if name != "depth_region"]
    return {
        "samples": int(summary["samples"].iloc[0]),
        "folds": results.config.folds,
        "summary": summary_table(summary).to_markdown(),
        "rule": by_name.loc[best_rule],
        "network": by_name.loc[best_network],
        "ahead": [TITLES[name] for name in ahead],
        "cases": cases_table(results, columns).to_markdown(),
        "comparison": rule_table(results, best_rule).to_markdown(),
        "angles": angle_table(results).to_markdown(),
    }


def related_summary(results: Results, by_pose: Results) -> pd.DataFrame:
    """Return `summarize_methods`, abstentions, and the macro F1 under protocol by-pose.

    Rules learn nothing, so that their score does not depend on the protocol.
    """
    summary = summarize_methods(results)
    counts = results.tested[results.tested["predicted"] == ABSTAINED]["method"].value_counts()
    unseen = summarize_methods(by_pose).set_index("method")["f1"]
    unseen = pd.concat([unseen, summary.set_index("method").loc[list(results.rules), "f1"]])
    return summary.assign(
        abstained=summary["method"].map(counts).fillna(0), unseen=summary["method"].map(unseen)
    )


def summary_table(summary: pd.DataFrame) -> Table:
    """Build the headline table."""
    columns = (
        method_column("method"),
        count_column("errors"),
        count_column("abstained"),
        number_column("f1", "macro F1"),
        interval_column("f1", "95 %"),
        number_column("unseen", "macro F1, unseen poses"),
    )
    note = (
        "Abstentions are counted among the errors. Unseen poses: protocol `by-pose`; rules are not trained."
    )
    return Table.from_frame("Rules and networks on the same samples", summary, columns, note)


def cases_table(results: Results, methods: Sequence[str]) -> Table:
    """Build the table of accuracy by what a sample shows."""
    frame = accuracy_by_case(results, methods, PAPER_CASES)
    return Table.from_frame(
        "Accuracy by case", frame, case_columns(methods), "An abstention counts as wrong."
    )


def rule_table(results: Results, rule: str) -> Table:
    """Build the table of samples that only the rule or only a network gets right."""
    columns = (
        method_column(),
        count_column("only_rule", "only the rule is right"),
        count_column("only_network", "only the network is right"),
        count_column("abstained", "of these, the rule abstained"),
    )
    frame = compare_with_rule(results, rule, results.networks)
    return Table.from_frame(f"`{rule}` against each network", frame, columns)


def angle_table(results: Results) -> Table:
    """Build the table of errors of the opening angle."""
    frame = score_angles(results)
    columns = (
        method_column("rule"),
        count_column("doors"),
        count_column("measured", "angle measured"),
        number_column("mean_deg", "mean", 1),
        number_column("median_deg", "median", 1),
        number_column("p95_deg", "95th percentile", 1),
    )
    title = "Error of the opening angle of semi-open and open doors, degrees"
    return Table.from_frame(title, frame[frame["region"] == ALL], columns)
