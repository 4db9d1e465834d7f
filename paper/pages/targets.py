# SPDX-License-Identifier: Apache-2.0
"""Targets for the weights of the mixture, and the values that networks reach."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import pandas as pd

from doorstate.evaluation.calibration import calibrate, reliability
from doorstate.evaluation.heads import head_errors, head_rows
from doorstate.evaluation.metrics import macro_f1
from doorstate.evaluation.results import Results
from doorstate.evaluation.table import Column, Table, label_column, number
from doorstate.evaluation.undecidable import is_undecidable
from doorstate.types import NO_DOOR

from ..paths import TITLES
from ..published import comparison, study
from .cases import Case

MIXTURE = "mixture-wide"
_Z95 = 1.96  # standard errors to either side of a 95 % interval


@dataclass(frozen=True)
class Estimate:
    """Value of a metric for a network, and half of its 95 % interval where samples are few."""

    value: float = math.nan
    margin: float = 0.0


def _mixture() -> Results:
    return comparison(MIXTURE)


@dataclass(frozen=True)
class Target:
    """Bound for a metric on some samples.

    Attributes:
        metric: name and unit of the metric.
        samples: description of the samples.
        bound: least value, or greatest if `at_most`.
        chosen: selects the rows of `Results.joined` that count.
        measure: evaluates a network on these rows.
        at_most: the bound is the greatest value.
        digits: decimals that are printed.
        results: returns the comparison that holds the rows.
    """

    metric: str
    samples: str
    bound: float
    chosen: Case
    measure: Callable[[Results, str, Case], Estimate]
    at_most: bool = False
    digits: int = 1
    results: Callable[[], Results] = _mixture

    def is_reached(self, estimate: Estimate) -> bool:
        """Return True if a value meets the bound; NaN does not."""
        return estimate.value <= self.bound if self.at_most else estimate.value >= self.bound

    def is_undecided(self, estimate: Estimate) -> bool:
        """Return True if the bound lies within the interval of a value."""
        return abs(estimate.value - self.bound) < estimate.margin


def seen_by_xtion(rows: pd.DataFrame) -> pd.Series[bool]:
    return (rows["sensor"] == "xtion") & rows["pose_id"].str.startswith("varied-") & _is_door(rows)


def _seen_by_xtion_decidable(rows: pd.DataFrame) -> pd.Series[bool]:
    return seen_by_xtion(rows) & ~is_undecidable(rows)


def _any(rows: pd.DataFrame) -> pd.Series[bool]:
    return rows["state"].notna()


def _is_door(rows: pd.DataFrame) -> pd.Series[bool]:
    return rows["state"] != NO_DOOR


def _cluttered(rows: pd.DataFrame) -> pd.Series[bool]:
    return rows["pose_id"].str.startswith("cluttered-") & rows["occluded_bin"].isin(["0", "0-25"])


def _has_hinge(rows: pd.DataFrame) -> pd.Series[bool]:
    return rows["hinge"].fillna("") != ""


def _macro_f1(results: Results, network: str, chosen: Case) -> Estimate:
    tested = results.tested_by(network)
    rows = tested[chosen(tested)]
    return Estimate(macro_f1(rows)) if len(rows) else Estimate()


def _accuracy_lost(results: Results, network: str, chosen: Case) -> Estimate:
    """Return how many points of accuracy doors lose that are hidden by up to a quarter."""
    tested = results.tested_by(network)
    rows = tested[chosen(tested)]
    free, hidden = (rows.loc[rows["occluded_bin"] == name, "correct"].astype(float) for name in ("0", "0-25"))
    if free.empty or hidden.empty:
        return Estimate()
    margin = _Z95 * math.sqrt(free.var(ddof=0) / len(free) + hidden.var(ddof=0) / len(hidden))
    return Estimate(100 * (free.mean() - hidden.mean()), 100 * margin)


def _calibration_error(results: Results, network: str, chosen: Case) -> Estimate:
    calibration = calibrate(results, network)
    if calibration is None:
        return Estimate()
    return Estimate(100 * reliability(calibration.true, calibration.scaled).error)


def _head(
    name: str,
    factor: float,
    results: Results,
    network: str,
    chosen: Case,
) -> Estimate:
    rows = head_rows(results, network)
    return Estimate() if rows is None else Estimate(factor * head_errors(rows)[name])


def _at_4096() -> Results:
    return study("mixture-points").parts["as-trained-4096"]


def _clutter() -> Results:
    return study("transfer").parts["mixture/cluttered"]


_POSITION = partial(_head, "frame_position_error_median_m", 100)
_YAW = partial(_head, "frame_yaw_error_median_deg", 1)
_F1, _LOST = "macro F1", "accuracy lost by a quarter hidden, points"
TARGETS = (
    Target(
        _F1,
        "`varied` doors seen by an Xtion, 4096 points",
        0.97,
        seen_by_xtion,
        _macro_f1,
        digits=4,
        results=_at_4096,
    ),
    Target(_F1, "the same doors, 1024 points", 0.97, seen_by_xtion, _macro_f1, digits=4),
    Target(
        _F1,
        "decidable ones, 1024 points",
        0.97,
        _seen_by_xtion_decidable,
        _macro_f1,
        digits=4,
    ),
    Target(
        "AUROC of a door",
        "all samples",
        0.99,
        _any,
        partial(_head, "door_auroc", 1),
        digits=4,
    ),
    Target("expected calibration error, %", "doors", 3, _is_door, _calibration_error, at_most=True),
    Target(
        "opening angle, mean error, °",
        "semi-open hinged doors",
        5,
        lambda rows: (rows["state"] == "semi_open") & rows["opening_angle_deg"].notna(),
        partial(_head, "angle_error_semi_open_deg", 1),
        at_most=True,
    ),
    Target("hinge side, % correct", "hinged doors", 98, _has_hinge, partial(_head, "hinge_accuracy", 100)),
    Target(
        "hinge side, % correct",
        "hinged doors, not closed",
        98,
        lambda rows: _has_hinge(rows) & (rows["state"] != "closed"),
        partial(_head, "hinge_accuracy_not_closed", 100),
    ),
    Target(
        "frame position, median error, cm",
        "doors",
        8,
        _is_door,
        _POSITION,
        at_most=True,
    ),
    Target(
        "frame yaw, median error, °",
        "doors",
        4,
        _is_door,
        _YAW,
        at_most=True,
    ),
    Target(_LOST, "`cluttered`, Kinect", 3, _cluttered, _accuracy_lost, at_most=True),
    Target(_LOST, "`cluttered`, Xtion", 3, _cluttered, _accuracy_lost, at_most=True, results=_clutter),
)


TARGET_COLUMNS = (
    label_column("metric"),
    Column("samples", ("samples", "count"), lambda samples, count: f"{samples} ({count})", is_label=True),
    Column("target", ("bound", "at_most"), lambda bound, at_most: f"{'≤' if at_most else '≥'} {bound:g}"),
)
"""Columns of a metric, its samples with their number, and its bound."""


def targets_frame(networks: Sequence[str]) -> pd.DataFrame:
    """Evaluate every network on every target.

    Returns:
        A row for each target, with columns metric, samples, count (of samples), bound, at_most, digits, reached and
        undecided (lists of networks), and for each network its value and `<network>_margin`.
    """
    rows = []
    for target in TARGETS:
        results = target.results()
        first = results.joined[
            (results.joined["method"] == results.networks[0]) & (results.joined["role"] == "test")
        ]
        estimates = {
            name: target.measure(results, name, target.chosen) if name in results.networks else Estimate()
            for name in networks
        }
        rows.append(
            {
                "metric": target.metric,
                "samples": target.samples,
                "count": int(target.chosen(first).sum()),
                "bound": target.bound,
                "at_most": target.at_most,
                "digits": target.digits,
                "reached": [name for name in networks if target.is_reached(estimates[name])],
                "undecided": [name for name in networks if target.is_undecided(estimates[name])],
                **{name: estimate.value for name, estimate in estimates.items()},
                **{f"{name}_margin": estimate.margin for name, estimate in estimates.items()},
            }
        )
    return pd.DataFrame(rows)


def targets_table(networks: Sequence[str]) -> Table:
    """Build the table of targets and of the values that every network reaches."""
    columns = (
        *TARGET_COLUMNS,
        *(Column(TITLES[name], (name, f"{name}_margin", "digits"), _estimate) for name in networks),
        Column("reached by", ("reached", "undecided"), _reached_by),
    )
    note = "±: half of the 95 % interval. Unsure: the interval contains the target."
    return Table.from_frame("Targets", targets_frame(networks), columns, note)


def _estimate(value: float, margin: float, digits: int) -> str:
    text = number(value, digits)
    return f"{text} ± {margin:.{digits}f}" if margin else text


def _reached_by(reached: Sequence[str], undecided: Sequence[str]) -> str:
    names, unsure = (", ".join(TITLES[name] for name in networks) for networks in (reached, undecided))
    return (names or "none") + (f"; unsure: {unsure}" if unsure else "")
