# SPDX-License-Identifier: Apache-2.0
"""Scores on recorded frames: few, of few doors, some without a door, so that intervals matter most."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from doorstate.evaluation.intervals import Interval, bootstrap_f1, bounds, grouped_interval, wilson_interval
from doorstate.evaluation.metrics import confusion, macro_f1, ratio
from doorstate.types import ABSTAINED, PREDICTED_LABELS, STATES

MIN_GROUPS = 5  # chosen: resamples of fewer are too much alike


@dataclass(frozen=True, eq=False)
class FrameScores:
    """Scores of every method on labelled frames.

    Columns of `scores` and of each of `strata`: method, (value,) frames, groups, correct, accuracy, f1 (macro) and
    abstained, with `_low` and `_high` of accuracy and F1 as if frames were independent, and `_grouped_low` and
    `_grouped_high` as if those of a group were not. An interval of F1 is NaN with fewer than five groups.
    """

    frames: int  # with a door of known state
    groups: int
    states: Mapping[str, int]  # frames of each state
    constant: str  # most frequent state
    scores: pd.DataFrame  # one row a method, and last one that always predicts `constant`
    recall: pd.DataFrame  # method, state, frames, groups, correct, recall with bounds
    confusion: pd.DataFrame  # method, state, one column a predicted label
    strata: Mapping[str, pd.DataFrame]
    stratum_groups: Mapping[str, str]
    """Column of the groups of a stratum that are not those of the other tables."""
    without_door: pd.DataFrame
    """Method, label, frames, predicted_states with bounds, one column a state, median and max probability."""

    def to_json(self) -> dict[str, Any]:
        """Return plain values, tables as lists of rows; an undefined number is None."""
        tables = {name: getattr(self, name) for name in ("scores", "recall", "confusion", "without_door")}
        return {
            "frames": self.frames,
            "groups": self.groups,
            "states": dict(self.states),
            "constant": self.constant,
            **{name: records(table) for name, table in tables.items()},
            "strata": {name: records(table) for name, table in self.strata.items()},
        }


def score_frames(
    predictions: pd.DataFrame,
    groups: pd.Series[str],
    strata: Mapping[str, pd.Series[str]],
    stratum_groups: Mapping[str, tuple[str, pd.Series[str]]] | None = None,
) -> FrameScores:
    """Score the predictions of every method.

    Args:
        predictions: N rows with columns method, state, predicted, the probabilities, and correct.
        groups: N names; frames with the same name depend on each other.
        strata: N values to score separately by, by name of the stratum.
        stratum_groups: column and N names, in place of `groups`, by name of the stratum; within one door, frames of one
            moment depend on each other.
    """
    nested = stratum_groups or {}
    is_door = predictions["state"].isin(STATES)
    doors = predictions.assign(group=groups)[is_door]
    methods = predictions["method"].drop_duplicates().tolist()
    of_first = doors[doors["method"] == methods[0]] if methods else doors
    counts = of_first["state"].value_counts().reindex(list(STATES), fill_value=0)
    constant = str(counts.idxmax())
    always = of_first.assign(
        method=f"always {constant}", predicted=constant, correct=(of_first["state"] == constant)
    )
    scores = [
        {"method": str(method), **_score(rows)}
        for method, rows in pd.concat([doors, always]).groupby("method", sort=False)
    ]
    return FrameScores(
        len(of_first),
        of_first["group"].nunique(),
        {str(state): int(count) for state, count in counts.items()},
        constant,
        pd.DataFrame(scores),
        _recall(doors),
        pd.DataFrame(
            [
                {"method": method, "state": state, **dict(zip(PREDICTED_LABELS, row, strict=True))}
                for method, rows in doors.groupby("method", sort=False)
                for state, row in zip(STATES, confusion(rows).tolist(), strict=True)
                if sum(row)
            ]
        ),
        {
            name: pd.DataFrame(
                [
                    {"method": method, "value": value, **_score(rows)}
                    for method, of_method in doors.assign(
                        value=values[is_door], group=nested.get(name, ("", groups))[1][is_door]
                    ).groupby("method", sort=False)
                    for value, rows in of_method.groupby("value", sort=False)
                ]
            )
            for name, values in strata.items()
        },
        {name: column for name, (column, _) in nested.items()},
        _score_without_door(predictions[~is_door]),
    )


def _score(rows: pd.DataFrame) -> dict[str, Any]:
    return {
        **_share(rows, "accuracy"),
        "f1": macro_f1(rows),
        **bounds("f1", _f1_interval(rows, pd.Series(range(len(rows))))),
        **bounds("f1_grouped", _f1_interval(rows, rows["group"])),
        "abstained": int((rows["predicted"] == ABSTAINED).sum()),
    }


def _share(rows: pd.DataFrame, name: str) -> dict[str, Any]:
    correct = rows["correct"].to_numpy(dtype=bool)
    return {
        "frames": len(rows),
        "groups": rows["group"].nunique(),
        "correct": int(correct.sum()),
        name: float(ratio(correct.sum(), len(rows))),
        **bounds(name, wilson_interval(int(correct.sum()), len(rows))),
        **bounds(f"{name}_grouped", grouped_interval(correct, rows["group"])),
    }


def _f1_interval(rows: pd.DataFrame, clusters: pd.Series[Any]) -> Interval:
    if clusters.nunique() < MIN_GROUPS:
        return float("nan"), float("nan")
    return bootstrap_f1(rows, clusters, np.random.default_rng(0)).macro


def _recall(doors: pd.DataFrame) -> pd.DataFrame:
    rows = [
        {"method": method, "state": state, **_share(of_method[of_method["state"] == state], "recall")}
        for method, of_method in doors.groupby("method", sort=False)
        for state in STATES
        if (of_method["state"] == state).any()
    ]
    return pd.DataFrame(rows)


def _score_without_door(predictions: pd.DataFrame) -> pd.DataFrame:
    rows = []
    for (method, label), frames in predictions.groupby(["method", "state"], sort=False):
        predicted = frames[frames["predicted"] != ABSTAINED]
        probability = predicted[[f"p_{state}" for state in STATES]].max(axis=1)
        rows.append(
            {
                "method": method,
                "label": label,
                "frames": len(frames),
                "predicted_states": len(predicted),
                **bounds("predicted_states", wilson_interval(len(predicted), len(frames))),
                **{state: int((predicted["predicted"] == state).sum()) for state in STATES},
                "probability_median": probability.median(),
                "probability_max": probability.max(),
            }
        )
    return pd.DataFrame(rows)


def records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the rows of a table as JSON values, NaN as None."""
    rows = table.to_dict("records")
    return [{str(key): None if value != value else value for key, value in row.items()} for row in rows]
