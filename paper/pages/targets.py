# SPDX-License-Identifier: Apache-2.0
"""Targets for the weights of the mixture, and the figures that networks reach."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import pandas as pd

from doorstate.evaluation.calibration import calibrate, reliability
from doorstate.evaluation.comparison import Results
from doorstate.evaluation.heads import head_errors, head_rows
from doorstate.evaluation.metrics import macro_f1
from doorstate.evaluation.table import Column, Table, label_column, number
from doorstate.evaluation.undecidable import is_undecidable
from doorstate.types import NO_DOOR

from ..paths import TITLES
from ..published import comparison, study
from .cases import Case

MIXTURE = "mixture-wide"
_Z95 = 1.96  # standard errors to either side of a 95 % interval


@dataclass(frozen=True)
class Measured:
    """Figure of a network, and half of its 95 % interval where samples are few."""

    value: float = math.nan
    margin: float = 0.0


def _mixture() -> Results:
    return comparison(MIXTURE)


@dataclass(frozen=True)
class Target:
    """Bound for a metric on some samples.

    Attributes:
        title: metric and unit.
        samples: samples in words.
        bound: least value, or greatest if `at_most`.
        chosen: rows of `Results.joined` that count.
        measure: of a network on these rows.
        results: comparison that holds them.
    """

    title: str
    samples: str
    bound: float
    chosen: Case
    measure: Callable[[Results, str, Case], Measured]
    at_most: bool = False
    digits: int = 1
    results: Callable[[], Results] = _mixture

    def reached(self, measured: Measured) -> bool:
        """Return whether a figure meets the bound; NaN does not."""
        return measured.value <= self.bound if self.at_most else measured.value >= self.bound

    def undecided(self, measured: Measured) -> bool:
        """Return whether the bound lies within the interval of a figure."""
        return abs(measured.value - self.bound) < measured.margin


def _noisy(rows: pd.DataFrame) -> pd.Series[bool]:
    return (rows["sensor"] == "xtion") & rows["pose_id"].str.startswith("varied-") & _is_door(rows)


def _noisy_decidable(rows: pd.DataFrame) -> pd.Series[bool]:
    return _noisy(rows) & ~is_undecidable(rows)


def _any(rows: pd.DataFrame) -> pd.Series[bool]:
    return rows["state"].notna()


def _is_door(rows: pd.DataFrame) -> pd.Series[bool]:
    return rows["state"] != NO_DOOR


def _cluttered(rows: pd.DataFrame) -> pd.Series[bool]:
    return rows["pose_id"].str.startswith("cluttered-") & rows["occluded_bin"].isin(["0", "0-25"])


def _has_hinge(rows: pd.DataFrame) -> pd.Series[bool]:
    return rows["hinge"].fillna("") != ""


def _macro_f1(results: Results, network: str, chosen: Case) -> Measured:
    tested = results.tested_by(network)
    rows = tested[chosen(tested)]
    return Measured(macro_f1(rows)) if len(rows) else Measured()


def _accuracy_lost(results: Results, network: str, chosen: Case) -> Measured:
    """Return how many points of accuracy doors lose that are hidden by up to a quarter."""
    tested = results.tested_by(network)
    rows = tested[chosen(tested)]
    free, hidden = (rows.loc[rows["occluded_bin"] == name, "correct"].astype(float) for name in ("0", "0-25"))
    if free.empty or hidden.empty:
        return Measured()
    margin = _Z95 * math.sqrt(free.var(ddof=0) / len(free) + hidden.var(ddof=0) / len(hidden))
    return Measured(100 * (free.mean() - hidden.mean()), 100 * margin)


def _calibration_error(results: Results, network: str, chosen: Case) -> Measured:
    calibration = calibrate(results, network)
    if calibration is None:
        return Measured()
    return Measured(100 * reliability(calibration.true, calibration.scaled).error)


def _head(
    name: str,
    factor: float,
    results: Results,
    network: str,
    chosen: Case,
) -> Measured:
    rows = head_rows(results, network)
    return Measured() if rows is None else Measured(factor * head_errors(rows)[name])


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
        _noisy,
        _macro_f1,
        digits=4,
        results=_at_4096,
    ),
    Target(_F1, "the same doors, 1024 points", 0.97, _noisy, _macro_f1, digits=4),
    Target(
        _F1,
        "decidable ones, 1024 points",
        0.97,
        lambda rows: _noisy(rows) & ~is_undecidable(rows),
        _macro_f1,
        digits=4,
    ),
    Target(
        "AUROC of a door",
        "all samples",
        0.99,
        lambda rows: rows["state"].notna(),
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
        partial(_head, "frame_position_error_median_m", 100),
        at_most=True,
    ),
    Target(
        "frame yaw, median error, °",
        "doors",
        4,
        _is_door,
        partial(_head, "frame_yaw_error_median_deg", 1),
        at_most=True,
    ),
    Target(_LOST, "`cluttered`, Kinect", 3, _cluttered, _accuracy_lost, at_most=True),
    Target(_LOST, "`cluttered`, Xtion", 3, _cluttered, _accuracy_lost, at_most=True, results=_clutter),
)


def targets_frame(networks: Sequence[str]) -> pd.DataFrame:
    """Return a row for each target: its texts, the number of samples, and a `Measured` for each network."""
    rows = []
    for target in TARGETS:
        results = target.results()
        first = results.joined[
            (results.joined["method"] == results.networks[0]) & (results.joined["role"] == "test")
        ]
        measured = {
            name: target.measure(results, name, target.chosen) if name in results.networks else Measured()
            for name in networks
        }
        met = [TITLES[name] for name in networks if target.reached(measured[name])]
        unsure = [TITLES[name] for name in networks if target.undecided(measured[name])]
        rows.append(
            {
                "title": target.title,
                "samples": f"{target.samples} ({int(target.chosen(first).sum())})",
                "bound": f"{'≤' if target.at_most else '≥'} {target.bound:g}",
                "reached": (", ".join(met) or "none") + (f"; unsure: {', '.join(unsure)}" if unsure else ""),
                "digits": target.digits,
                **measured,
            }
        )
    return pd.DataFrame(rows)


def targets_table(networks: Sequence[str]) -> Table:
    """Build the table of targets and of what every network reaches."""
    columns = (
        label_column("title", "metric"),
        label_column("samples"),
        Column("target", ("bound",), str),
        *(Column(TITLES[name], (name, "digits"), _cell) for name in networks),
        Column("reached by", ("reached",), str),
    )
    return Table.from_frame("Targets", targets_frame(networks), columns)


def _cell(measured: Measured, digits: int) -> str:
    text = number(measured.value, digits)
    return f"{text} ± {measured.margin:.{digits}f}" if measured.margin else text
