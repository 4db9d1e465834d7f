# SPDX-License-Identifier: Apache-2.0
"""Answers of the check of each doorway at true doorways, by state and by what the leaf is made of."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from doorstate._jobs import Progress
from doorstate.evaluation.table import Table
from doorstate.inference.door import Door
from doorstate.inference.doorway_check import DoorwayCheck
from doorstate.inference.gate import DEFAULT_GATE
from doorstate.simulation.truth import TrueDoor, true_doors
from doorstate.types import DoorState, Points

from .dark_leaves import dark_leaf
from .doorways import VISIBLE_PX, Source, simulated_views
from .words import count_words

_SEED = 77_001  # of no data set, and of no constant of the check
SOURCES: tuple[Source, ...] = tuple(
    (preset, sensor) for preset in ("varied", "cluttered") for sensor in ("xtion", "d435")
)
_LEAVES = {"full_glass": "glass", "glazed": "glazed", "sliding": "sliding"}  # others are opaque


class CheckResult(NamedTuple):
    """Checks of one doorway."""

    preset: str
    state: str
    leaf: str
    refused: str  # code of the reason against its true state; empty if that is confirmed
    is_open: bool  # "open" is confirmed
    leaf_seen: bool  # and a leaf seen


def measure_doorway_gate(scenes: int, progress: Progress) -> list[CheckResult]:
    """Return the checks of doors with at least 1500 visible pixels, as they are and with nothing of the leaf measured.

    Args:
        scenes: scenes of each preset and sensor.
        progress: called after each scene.
    """
    results = []
    for preset, _, row, frame in simulated_views(SOURCES, scenes, progress, _SEED):
        door = true_doors(row)[0]
        if door.visible_px.total < VISIBLE_PX:
            continue
        leaf = _LEAVES.get(door.kind, "opaque")
        results.append(_result(preset, leaf, frame.points, door))
        if leaf != "glass":
            results.append(_result(preset, f"dark {leaf}", dark_leaf(frame), door))
    return results


def doorway_gate_table(results: Sequence[CheckResult]) -> Table:
    """Return one row for each preset, state and leaf."""
    rows = []
    for preset, state, leaf in sorted({(result.preset, result.state, result.leaf) for result in results}):
        part = [
            result
            for result in results
            if (result.preset, result.state, result.leaf) == (preset, state, leaf)
        ]
        reasons = [result.refused for result in part if result.refused]
        count = len(part)
        rows.append(
            (
                preset,
                state,
                leaf,
                count_words(reasons) or "–",
                str(count),
                f"{1 - len(reasons) / count:.2f}",
                f"{sum(result.is_open for result in part) / count:.2f}",
                f"{sum(result.leaf_seen for result in part) / count:.2f}",
            )
        )
    return Table(
        "Checks of doorways",
        ("preset", "state", "leaf", "reasons", "doors", "answered", "confirmed as open", "with a seen leaf"),
        tuple(rows),
        "Doorways where they truly are, measured as by `xtion` and `d435`. *Answered*: the true state is confirmed; "
        "*reasons*: against it. *Confirmed as open*: of doors in any state that are called open. Nothing of *dark* "
        "leaves is measured but handles and panes.",
        text_columns=4,
    )


def _result(preset: str, leaf: str, cloud: Points, door: TrueDoor) -> CheckResult:
    true, opened = (_check(cloud, door, state) for state in (DoorState(door.state), DoorState.OPEN))
    is_open = opened.abstention is None
    refused = "" if true.abstention is None else true.abstention.code
    return CheckResult(preset, str(door.state), leaf, refused, is_open, is_open and bool(opened.leaf_seen))


def _check(cloud: Points, door: TrueDoor, state: DoorState) -> DoorwayCheck:
    said = Door(door.x_m, door.y_m, door.yaw_deg, door.width_m, state, floor_z_m=door.floor_z_m)
    (check,) = DEFAULT_GATE.check_doorways(cloud, [said])
    return check
