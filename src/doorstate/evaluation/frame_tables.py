# SPDX-License-Identifier: Apache-2.0
"""Tables of scores on recorded frames."""

from __future__ import annotations

from doorstate.evaluation.frame_scores import FrameScores
from doorstate.evaluation.table import (
    UNDEFINED,
    Column,
    Table,
    count_column,
    interval_column,
    label_column,
    number_column,
)
from doorstate.types import ABSTAINED, PREDICTED_LABELS, STATES

NO_GROUP = "frame"

_METHOD = label_column("method")


def frame_tables(scores: FrameScores, group: str = NO_GROUP) -> dict[str, Table]:
    """Build every table that has a row, by the name of its file.

    Args:
        scores: result of `FrameResults.score`.
        group: column of the groups, such as `door`; `frame` if frames are independent.
    """
    tables = {
        "scores": _scores_table(scores, group),
        "recall": _recall_table(scores, group),
        "confusion": Table.from_frame(
            "Predictions by true state",
            scores.confusion,
            (_METHOD, label_column("state", "true state"), *map(count_column, PREDICTED_LABELS)),
        ),
        **{
            f"by_{name.replace(':', '_')}": _stratum_table(
                scores, name, scores.stratum_groups.get(name, group)
            )
            for name in scores.strata
        },
        "without_door": _without_door_table(scores),
    }
    return {name: table for name, table in tables.items() if table.rows}


def frame_notes(scores: FrameScores, group: str = NO_GROUP) -> list[str]:
    """Return notes to read before the numbers.

    Args:
        scores: result of `FrameResults.score`.
        group: as for `frame_tables`.
    """
    if not scores.frames:
        return ["No frame shows a door of known state."]
    counts = ", ".join(f"{count} {state.replace('_', '-')}" for state, count in scores.states.items())
    groups = "" if group == NO_GROUP else f" of {scores.groups} {group}s (column {group})"
    constant = scores.constant
    return [
        f"{scores.frames} frames with a door{groups}: {counts}.",
        f"A method that always predicts {constant.replace('_', '-')} is correct on {scores.states[constant]} of them.",
    ]


def _scores_table(scores: FrameScores, group: str) -> Table:
    note = "Intervals of 95 %: Wilson for accuracy, bootstrap for F1, as if frames were independent"
    note += (
        "."
        if group == NO_GROUP
        else f"; and as if the frames of one {group} were copies of one, or drawn by {group}. "
        f"The truth lies between. {UNDEFINED}: too few."
    )
    table = scores.scores if scores.frames else scores.scores.iloc[:0]
    return Table.from_frame("Frames with a door", table, (_METHOD, *_score_columns(group)), note)


def _stratum_table(scores: FrameScores, name: str, group: str) -> Table:
    columns = (_METHOD, label_column("value", name), *_score_columns(group))
    return Table.from_frame(f"Scores by {name}", scores.strata[name], columns)


def _score_columns(group: str) -> tuple[Column, ...]:
    return (
        count_column("frames"),
        count_column("correct"),
        number_column("accuracy", digits=2),
        interval_column("accuracy", "95 %", 2),
        *_group_columns("accuracy", group),
        number_column("f1", "macro F1", 2),
        interval_column("f1", "95 %", 2),
        *([] if group == NO_GROUP else [interval_column("f1_grouped", f"95 %, by {group}", 2)]),
        count_column(ABSTAINED),
    )


def _group_columns(name: str, group: str) -> list[Column]:
    if group == NO_GROUP:
        return []
    grouped = interval_column(f"{name}_grouped", f"95 %, a {group} as one", 2)
    return [count_column("groups", f"{group}s"), grouped]


def _recall_table(scores: FrameScores, group: str) -> Table:
    return Table.from_frame(
        "Recall of each state",
        scores.recall,
        (
            _METHOD,
            label_column("state"),
            Column("correct", ("correct", "frames"), lambda correct, frames: f"{correct} of {frames}"),
            number_column("recall", digits=2),
            interval_column("recall", "95 %", 2),
            *_group_columns("recall", group),
        ),
    )


def _without_door_table(scores: FrameScores) -> Table:
    return Table.from_frame(
        "Frames without a clear door",
        scores.without_door,
        (
            _METHOD,
            label_column("label"),
            count_column("frames"),
            count_column("predicted_states", "predicted a state"),
            interval_column("predicted_states", "95 %", 2),
            *map(count_column, STATES),
            number_column("probability_median", "median probability", 2),
            number_column("probability_max", "largest", 2),
        ),
        "Probability: of the predicted state. Rules give none.",
    )
