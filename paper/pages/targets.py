# SPDX-License-Identifier: Apache-2.0
"""What was asked of the mixture's weights, and what each network reaches: the first table of docs/generalization.md."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.calibration import calibrate, reliability
from doorstate.evaluation.head_tables import answer_errors
from doorstate.evaluation.metrics import confusion_matrix, scores
from doorstate.evaluation.results import ComparisonResults
from doorstate.evaluation.stratum_tables import is_undecidable
from doorstate.evaluation.stratum_tables import rows_of as manifest_of
from doorstate.evaluation.table import Table, number
from doorstate.types import NO_DOOR

from .results import NAMES

MIXTURE = "mixture-wide"  # the comparison of the page
AT_4096 = "mixture-points/as-trained-4096"
CLUTTER = "transfer/mixture/cluttered"
_95 = 1.96  # standard errors to either side

Row = Mapping[str, str]


class Published(NamedTuple):
    """A published comparison, and the rows of what it tested."""

    results: ComparisonResults
    dataset: PreparedDataset


class Found(NamedTuple):
    """How well a network does; the margin is half of an interval of 95 %, where so few samples are told apart."""

    value: float = math.nan
    margin: float = 0.0


class Target(NamedTuple):
    """Something that was asked for, of which samples, and how well a network does at it."""

    words: str
    bound: float
    more_is_better: bool
    digits: int
    samples: str
    is_one: Callable[[Row], bool]  # of a row of the manifest
    found: Callable[[Published, str], Found]
    where: str = MIXTURE  # published comparison that tells

    def reached(self, found: Found) -> bool:
        """Whether a figure is good enough; one that nobody knows is not."""
        return bool(found.value >= self.bound if self.more_is_better else found.value <= self.bound)

    def undecided(self, found: Found) -> bool:
        """Whether the samples are too few to tell."""
        return abs(found.value - self.bound) < found.margin


def _noisy(row: Row) -> bool:
    return row["sensor"] == "xtion" and row["pose_id"].startswith("varied-") and _is_door(row)


def _noisy_decidable(row: Row) -> bool:
    return _noisy(row) and not is_undecidable(row)


def _is_door(row: Row) -> bool:
    return row["state"] != NO_DOOR


def _is_cluttered(row: Row) -> bool:
    return row["pose_id"].startswith("cluttered-") and row["occluded_bin"] in ("0", "0-25")


def _macro_f1(is_one: Callable[[Row], bool], published: Published, network: str) -> Found:
    results, dataset = published
    pooled = results.pooled(network)
    chosen = np.array([is_one(row) for row in manifest_of(dataset, pooled)])
    if not chosen.any():
        return Found()
    return Found(float(scores(confusion_matrix(pooled.true[chosen], pooled.predicted[chosen])).macro.f1))


def _points_lost(published: Published, network: str) -> Found:
    """By clutter that hides up to a quarter of a door, against none of it, in points of accuracy."""
    results, dataset = published
    pooled = results.pooled(network)
    rows = manifest_of(dataset, pooled)
    bins = np.array([row["occluded_bin"] if _is_cluttered(row) else "" for row in rows])
    free, hidden = (pooled.right[bins == name] for name in ("0", "0-25"))
    if not (len(free) and len(hidden)):
        return Found()
    margin = _95 * math.sqrt(free.var() / len(free) + hidden.var() / len(hidden))
    return Found(100 * float(free.mean() - hidden.mean()), 100 * margin)


def _calibration_error(published: Published, network: str) -> Found:
    found = calibrate(published.results, network)
    return Found() if found is None else Found(100 * reliability(found.true, found.scaled).error)


def _head(name: str, factor: float = 1.0) -> Callable[[Published, str], Found]:
    def found(published: Published, network: str) -> Found:
        given = published.results.answers(network)
        return Found() if given is None else Found(factor * answer_errors(given, published.dataset)[name])

    return found


_MACRO_F1 = "macro F1 of three states"
_LOST = "points of accuracy lost where up to a quarter of the door is hidden"
TARGETS = (
    Target(
        _MACRO_F1,
        0.97,
        True,
        4,
        "doors of `varied`, Xtion, 4096 points",
        _noisy,
        partial(_macro_f1, _noisy),
        AT_4096,
    ),
    Target(_MACRO_F1, 0.97, True, 4, "the same, 1024 points", _noisy, partial(_macro_f1, _noisy)),
    Target(
        _MACRO_F1,
        0.97,
        True,
        4,
        "of them look like no other state",
        _noisy_decidable,
        partial(_macro_f1, _noisy_decidable),
    ),
    Target(
        "AUROC of *there is a door*",
        0.99,
        True,
        4,
        "samples of all kinds",
        lambda row: True,
        _head("door, AUROC"),
    ),
    Target("expected calibration error, %", 3, False, 1, "doors of all kinds", _is_door, _calibration_error),
    Target(
        "opening angle, mean error, °",
        5,
        False,
        1,
        "semi-open doors that turn",
        lambda row: row["state"] == "semi_open" and bool(row["opening_angle_deg"]),
        _head("opening angle, semi-open: mean error, °"),
    ),
    Target(
        "hinge side, % right",
        98,
        True,
        1,
        "doors with hinges",
        lambda row: bool(row["hinge"]),
        _head("hinge side", 100),
    ),
    Target(
        "the same",
        98,
        True,
        1,
        "of them not closed",
        lambda row: bool(row["hinge"]) and row["state"] != "closed",
        _head("of doors not closed", 100),
    ),
    Target(
        "frame position, median error, cm",
        8,
        False,
        1,
        "doors of all kinds",
        _is_door,
        _head("frame position: median error, m", 100),
    ),
    Target(
        "frame yaw, median error, °",
        4,
        False,
        1,
        "doors of all kinds",
        _is_door,
        _head("yaw: median error, °"),
    ),
    Target(_LOST, 3, False, 1, "doors of `cluttered`, Kinect", _is_cluttered, _points_lost),
    Target(_LOST, 3, False, 1, "doors of `cluttered`, Xtion", _is_cluttered, _points_lost, CLUTTER),
)


def targets_table(published: Mapping[str, Published], networks: Sequence[str]) -> Table:
    """What was asked for, and what every network reaches; what is not published yet nobody knows.

    Args:
        published: comparisons by where they lie in the folder of everything published.
        networks: in the order of columns.
    """
    rows = []
    for target in TARGETS:
        found = dict.fromkeys(networks, Found())
        samples = "–"
        if target.where in published:
            here = published[target.where]
            found |= {name: target.found(here, name) for name in here.results.networks if name in networks}
            samples = f"{_count(target, here)} {target.samples}"
        good = [NAMES[name] for name in networks if target.reached(found[name])]
        open_ = [NAMES[name] for name in networks if target.undecided(found[name])]
        said = "all" if len(good) == len(networks) else ", ".join(good) or "none"
        rows.append(
            (
                target.words,
                samples,
                f"{'≥' if target.more_is_better else '≤'} {target.bound:g}",
                *(_cell(found[name], target.digits) for name in networks),
                said + (f"; too few to tell: {', '.join(open_)}" if open_ else ""),
            )
        )
    columns = ("", "of", "asked for", *(NAMES[name] for name in networks), "reached by")
    return Table("What was asked for, and what is reached", columns, tuple(rows), text_columns=2)


def _count(target: Target, published: Published) -> int:
    """Tested samples of a target, by the network that says most of them."""
    results, dataset = published
    given = results.answers(results.networks[0])
    rows = manifest_of(dataset, results.pooled(results.networks[0]) if given is None else given)
    return sum(map(target.is_one, rows))


def _cell(found: Found, digits: int) -> str:
    text = number(found.value, digits)
    return f"{text} ± {found.margin:.{digits}f}" if found.margin else text
