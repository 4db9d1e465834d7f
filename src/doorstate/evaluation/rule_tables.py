# SPDX-License-Identifier: Apache-2.0
"""Tables of the outputs of rules besides the state."""

from __future__ import annotations

from doorstate.evaluation.results import Results
from doorstate.evaluation.rule_outputs import count_abstentions, score_angles, score_open_or_not
from doorstate.evaluation.table import Table, count_column, label_column, number_column

_METHOD = label_column("method")


def angle_table(results: Results) -> Table:
    """Build the table of errors of the opening angle, by region."""
    return Table.from_frame(
        "Error of the opening angle, in degrees",
        score_angles(results),
        (
            _METHOD,
            label_column("region"),
            count_column("doors"),
            count_column("measured", "angle measured"),
            number_column("mean_deg", "mean", 1),
            number_column("median_deg", "median", 1),
            number_column("p95_deg", "95th percentile", 1),
        ),
        "Semi-open and open doors. True angles are the simulator's; a sample without a measured angle is not counted.",
    )


def open_or_not_table(results: Results) -> Table:
    """Build the table of open against not open."""
    return Table.from_frame(
        "Open or not",
        score_open_or_not(results),
        (
            _METHOD,
            number_column("recall", "recall of open"),
            number_column("precision", "precision of open"),
            number_column("accuracy"),
            count_column("abstained"),
        ),
        "Closed and semi-open are both not open. An abstention counts as wrong.",
    )


def abstentions_table(results: Results) -> Table:
    """Build the table of reasons to abstain."""
    columns = (_METHOD, label_column("reason"), count_column("samples"))
    return Table.from_frame("Reasons to abstain", count_abstentions(results), columns)
