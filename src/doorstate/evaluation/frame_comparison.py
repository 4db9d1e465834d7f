# SPDX-License-Identifier: Apache-2.0
"""Methods side by side on recorded frames: accuracy by frames, moments and doors, and changes from the first one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from doorstate.evaluation.frame_scores import MIN_GROUPS, records
from doorstate.evaluation.intervals import Interval, bootstrap_mean, bounds, grouped_interval
from doorstate.evaluation.metrics import ratio
from doorstate.evaluation.table import (
    UNDEFINED,
    Column,
    Table,
    count_column,
    interval_column,
    label_column,
    number_column,
)
from doorstate.types import ABSTAINED, STATES


@dataclass(frozen=True, eq=False)
class FrameComparison:
    """Scores of the frames with a door of known state.

    Columns of `units`: method, unit (frame, moment, door), units, frames, correct, accuracy and its bounds as if the
    frames of one unit were copies of one. Columns of `changes`: before (the first method), after (another), frames,
    correct and share of wrong states among the states given of both, frames corrected and broken, the difference of
    accuracy, and its bounds with frames and with groups drawn; these are NaN with fewer than five of them.
    """

    group: str  # column of the groups
    units: pd.DataFrame
    changes: pd.DataFrame

    def to_json(self) -> dict[str, Any]:
        """Return plain values, tables as lists of rows; an undefined number is None."""
        return {"units": records(self.units), "changes": records(self.changes)}

    def tables(self) -> dict[str, Table]:
        """Build every table that has a row, by the name of its file."""
        tables = {"changes": self._changes_table()} if len(self.changes) else {}
        return tables | ({"units": self._units_table()} if len(self.units) else {})

    def _units_table(self) -> Table:
        return Table.from_frame(
            "Accuracy by what is independent",
            self.units,
            (
                label_column("method"),
                label_column("unit"),
                count_column("units"),
                count_column("frames"),
                number_column("accuracy", digits=2),
                interval_column("accuracy", "95 %", 2),
            ),
            "Wilson intervals of 95 %, as if all frames of one unit were copies of one.",
        )

    def _changes_table(self) -> Table:
        return Table.from_frame(
            "Before and after",
            self.changes,
            (
                label_column("before"),
                label_column("after"),
                count_column("frames"),
                _pair("correct", 0),
                _pair("wrong_share", 2, "wrong among states given"),
                count_column("corrected"),
                count_column("broken"),
                number_column("difference", digits=2),
                interval_column("difference", "95 %", 2),
                *(
                    [interval_column("difference_grouped", f"95 %, by {self.group}", 2)]
                    if self.group != "frame"
                    else []
                ),
            ),
            "Corrected: wrong or abstained before, right after. Difference: of the accuracy; bootstrap of pairs.",
        )


def compare_methods(
    predictions: pd.DataFrame, groups: Mapping[str, pd.Series[str]], group: str
) -> FrameComparison:
    """Compare the methods.

    Args:
        predictions: N rows with columns method, sample_id, state, predicted and correct; those of a method in the order
            of the frames.
        groups: N names of what may be independent, by unit; `frame` is one of the units.
        group: unit by which differences are drawn.
    """
    is_door = predictions["state"].isin(STATES)
    doors = predictions[is_door]
    units = [
        {"method": str(method), **_unit(unit, rows["correct"].to_numpy(bool), names[rows.index])}
        for method, rows in doors.groupby("method", sort=False)
        for unit, names in groups.items()
    ]
    by_method = {str(method): rows for method, rows in doors.groupby("method", sort=False)}
    first = next(iter(by_method), "")
    changes = [
        {"before": first, "after": after, **_change(by_method[first], rows, groups[group])}
        for after, rows in by_method.items()
        if after != first
    ]
    return FrameComparison(group, pd.DataFrame(units), pd.DataFrame(changes))


def changed_label(before: str, after: str, state: str) -> str:
    """Return the kind of a change of a prediction: corrected, broken, changed, or "" without one."""
    if before == after:
        return ""
    if state not in STATES:
        return "changed"
    return "corrected" if after == state else "broken" if before == state else "changed"


def _unit(unit: str, correct: NDArray[np.bool_], names: pd.Series[str]) -> dict[str, Any]:
    return {
        "unit": unit,
        "units": names.nunique(),
        "frames": len(correct),
        "correct": int(correct.sum()),
        "accuracy": float(ratio(correct.sum(), len(correct))),
        **bounds("accuracy", grouped_interval(correct, names)),
    }


def _change(before: pd.DataFrame, after: pd.DataFrame, groups: pd.Series[str]) -> dict[str, Any]:
    right = [rows["correct"].to_numpy(bool) for rows in (before, after)]
    step = right[1].astype(int) - right[0].astype(int)
    names = groups[before.index]
    return {
        "frames": len(step),
        "correct_before": int(right[0].sum()),
        "correct_after": int(right[1].sum()),
        "wrong_share_before": _wrong_share(before),
        "wrong_share_after": _wrong_share(after),
        "corrected": int((step == 1).sum()),
        "broken": int((step == -1).sum()),
        "difference": float(ratio(step.sum(), len(step))),
        **bounds("difference", _interval(step, pd.Series(range(len(step))))),
        **bounds("difference_grouped", _interval(step, names)),
    }


def _wrong_share(rows: pd.DataFrame) -> float:
    given = rows[rows["predicted"] != ABSTAINED]
    return float(ratio((~given["correct"].to_numpy(bool)).sum(), len(given)))


def _interval(step: NDArray[Any], clusters: pd.Series[Any]) -> Interval:
    if clusters.nunique() < MIN_GROUPS:
        return float("nan"), float("nan")
    return bootstrap_mean(step, clusters, np.random.default_rng(0))


def _pair(name: str, digits: int, title: str | None = None) -> Column:
    """Return a column `before → after`."""

    def write(before: float, after: float) -> str:
        texts = (UNDEFINED if value != value else f"{value:.{digits}f}" for value in (before, after))
        return " → ".join(texts)

    return Column(title or name, (f"{name}_before", f"{name}_after"), write)
