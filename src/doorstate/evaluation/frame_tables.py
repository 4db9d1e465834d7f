# SPDX-License-Identifier: Apache-2.0
"""Tables of recorded frames, from the metrics that are also written as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence

from doorstate.evaluation.frame_metrics import Metrics
from doorstate.evaluation.table import UNDEFINED, Table, interval, number
from doorstate.types import PREDICTED_LABELS, STATES

NO_GROUP = "frame"


def frame_tables(metrics: Metrics, group: str = NO_GROUP) -> dict[str, Table]:
    """Every table that has a row, by the name of its file.

    Args:
        metrics: of `frame_metrics.measure`.
        group: what the groups are, such as `door`; of frames each for itself, `frame`.
    """
    tables = {
        "scores": _scores(metrics, group),
        "recall": _recall(metrics, group),
        "confusion": _confusion(metrics),
        **{f"by_{name.replace(':', '_')}": _strata(metrics, name, group) for name in _strata_names(metrics)},
        "without_a_door": _without(metrics),
    }
    return {name: table for name, table in tables.items() if table.rows}


def frame_notes(metrics: Metrics, group: str = NO_GROUP) -> list[str]:
    """What is to be known before the numbers are read.

    Args:
        metrics: of `frame_metrics.measure`.
        group: as of `frame_tables`.
    """
    if not metrics["frames"]:
        return ["No frame shows a door whose state is known."]
    counts = ", ".join(f"{count} {state.replace('_', '-')}" for state, count in metrics["states"].items())
    of_groups = "" if group == NO_GROUP else f" of {metrics['groups']} {group}s, as column {group} names them"
    constant = metrics["constant"]["answer"].replace("_", "-"), metrics["constant"]["all"]["right"]
    return [
        f"{metrics['frames']} frames with a door{of_groups}: {counts}.",
        f"Always saying {constant[0]} would be right about {constant[1]} of them.",
    ]


def _scores(metrics: Metrics, group: str) -> Table:
    constant = metrics["constant"]
    lines = {name: each["all"] for name, each in metrics["methods"].items()}
    lines |= {f"always {constant['answer']}": constant["all"]} if metrics["frames"] else {}
    rows = [(name, *_cells(score, group)) for name, score in lines.items() if score["frames"]]
    note = "Intervals of 95 %: Wilson's of accuracy, the bootstrap's of F1, as if frames were independent"
    note += (
        "."
        if group == NO_GROUP
        else f"; and as if those of one {group} said no more than one of them, or drawn by {group}. "
        f"The truth lies between. {UNDEFINED}: too few."
    )
    return Table("Frames with a door", _score_columns(("method",), group), tuple(rows), note)


def _strata_names(metrics: Metrics) -> Sequence[str]:
    return list(dict.fromkeys(name for each in metrics["methods"].values() for name in each["by"]))


def _strata(metrics: Metrics, name: str, group: str) -> Table:
    rows = [
        (method, value, *_cells(score, group))
        for method, each in metrics["methods"].items()
        for value, score in each["by"][name].items()
    ]
    return Table(f"Apart by {name}", _score_columns(("method", name), group), tuple(rows), text_columns=2)


def _score_columns(first: tuple[str, ...], group: str) -> tuple[str, ...]:
    grouped = () if group == NO_GROUP else (f"{group}s", f"95 %, a {group} as one")
    of_f1 = () if group == NO_GROUP else (f"95 %, by {group}",)
    return (*first, "frames", "right", "accuracy", "95 %", *grouped, "macro F1", "95 %", *of_f1, "no answer")


def _cells(score: Metrics, group: str) -> tuple[str, ...]:
    grouped = () if group == NO_GROUP else (str(score["groups"]), _interval(score["interval_by_group"]))
    return (
        str(score["frames"]),
        str(score["right"]),
        _number(score["share"]),
        _interval(score["interval"]),
        *grouped,
        _number(score["macro_f1"]),
        _interval(score["macro_f1_interval"]),
        *(() if group == NO_GROUP else (_interval(score["macro_f1_interval_by_group"]),)),
        str(score["abstained"]),
    )


def _recall(metrics: Metrics, group: str) -> Table:
    grouped = () if group == NO_GROUP else (f"{group}s", f"95 %, a {group} as one")
    rows = []
    for method, each in metrics["methods"].items():
        for state in STATES:
            share = each["all"]["states"][state]
            if share["frames"]:
                cells = (str(share["groups"]), _interval(share["interval_by_group"])) if grouped else ()
                right = f"{share['right']} of {share['frames']}"
                rows.append(
                    (method, state, right, _number(share["share"]), _interval(share["interval"]), *cells)
                )
    columns = ("method", "state", "right", "recall", "95 %", *grouped)
    return Table("Recall of each state", columns, tuple(rows), text_columns=2)


def _confusion(metrics: Metrics) -> Table:
    rows = [
        (method, state, *map(str, counts))
        for method, each in metrics["methods"].items()
        for state, counts in zip(STATES, each["all"]["confusion"], strict=True)
        if sum(counts)
    ]
    return Table(
        "Answers by true state", ("method", "true state", *PREDICTED_LABELS), tuple(rows), text_columns=2
    )


def _without(metrics: Metrics) -> Table:
    rows = [
        (
            method,
            label,
            str(found["frames"]),
            str(found["given_a_state"]),
            _interval(found["interval"]),
            *(str(found["states"][state]) for state in STATES),
            _number(found["median_probability"]),
            _number(found["largest_probability"]),
        )
        for method, each in metrics["methods"].items()
        for label, found in each["without_a_door"].items()
    ]
    note = "Probability: of the state that was given. Rules give 1."
    columns = ("method", "label", "frames", "given a state", "95 %", *STATES, "median probability", "largest")
    return Table("Frames without a clear door", columns, tuple(rows), note, text_columns=2)


def _number(value: float | None) -> str:
    return number(math.nan if value is None else value, 2)


def _interval(low_high: Sequence[float] | None) -> str:
    return interval((math.nan, math.nan) if low_high is None else (low_high[0], low_high[1]), 2)
