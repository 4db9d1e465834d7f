# SPDX-License-Identifier: Apache-2.0
"""Tables of the outputs of further heads."""

from __future__ import annotations

from doorstate.evaluation.heads import PART_NAMES, score_four_labels, score_heads, score_parts, score_presence
from doorstate.evaluation.results import Results
from doorstate.evaluation.table import Column, Table, count_column, label_column, number_column
from doorstate.networks.heads import HEADS
from doorstate.types import NO_DOOR, STATES

_METHOD = label_column("method")
_METRICS = [metric for head in HEADS.values() for metric in head.metrics]


def head_tables(results: Results) -> dict[str, Table]:
    """Build the tables of further heads, by the name of their files; they are empty where no network has such heads."""
    return {
        "head_errors": head_errors_table(results),
        "four_labels": four_labels_table(results),
        "presence": presence_table(results),
        "parts": parts_table(results),
    }


def head_errors_table(results: Results) -> Table:
    """Build the table of errors of every head."""
    return Table.from_frame(
        "Outputs of further heads",
        score_heads(results),
        (
            _METHOD,
            count_column("samples"),
            *(number_column(metric.name, metric.title, metric.digits) for metric in _METRICS),
        ),
        "AUROC: how well the probability of a door puts samples with a door above those without. Hinge: share "
        "correct; a flush closed leaf may show its side by nothing but the handle. Samples whose true value the "
        "manifest does not record are not counted.",
    )


def four_labels_table(results: Results) -> Table:
    """Build the table of predictors that name a state or no door."""
    return Table.from_frame(
        "Four labels: a state, or no door",
        score_four_labels(results),
        (
            _METHOD,
            count_column("samples"),
            *(number_column(label, f"recall of {label}") for label in (*STATES, NO_DOOR)),
            number_column("mean"),
            number_column("accuracy"),
        ),
        "A state is correct if it is the true one, and if a door is likelier than none.",
    )


def presence_table(results: Results) -> Table:
    """Build the table of predicted doors, by what the scene holds."""
    return Table.from_frame(
        "Is there a door?",
        score_presence(results),
        (
            _METHOD,
            Column("a door", ("door",), lambda door: "yes" if door else "no", is_label=True),
            label_column("kind"),
            count_column("samples"),
            count_column("predicted_door", "predicted a door"),
            number_column("share"),
        ),
    )


def parts_table(results: Results) -> Table:
    """Build the table of the intersection over union of each part."""
    return Table.from_frame(
        "Parts of points: intersection over union",
        score_parts(results),
        (_METHOD, *(number_column(name, digits=3) for name in (*PART_NAMES, "mean"))),
    )
