# SPDX-License-Identifier: Apache-2.0
"""Check of single doors: a reason against a state that the cloud does not show at the door's place."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from doorstate.doorways.doorway import Doorway
from doorstate.doorways.evidence import DoorwayEvidence, find_evidence
from doorstate.doorways.finder import thinned
from doorstate.doorways.leaf_shape import find_leaf_angle_deg
from doorstate.doorways.leaf_sweep import MIN_WIDTH_M, SEMI_OPEN_ANGLES_DEG, SeenLeaf, sweep_leaf
from doorstate.doorways.measured_view import MeasuredView
from doorstate.inference.abstention import Abstention
from doorstate.inference.door import Door
from doorstate.inference.seen_through import FloorRays, Opening, floor_rays
from doorstate.types import DoorState, Hinge, Points

_MAX_POINTS = 12_000  # of a cloud: eight for each cell of a door 2.5 m away
# Shares of the cells of an opening that are in view, as in `DoorwayEvidence`; "free" is before and across which nothing
# stands.
_MIN_IN_VIEW = 0.06  # of all cells
_MIN_SURFACE = 0.25  # on the wall: of a closed door, and of a leaf ajar
_MOSTLY_FLUSH = 0.8  # flush, of what is on the wall: no leaf ajar
_MIN_PART = 0.15  # flush: of a leaf that is pushed aside, as of sliding doors
_MIN_THROUGH = 0.1  # through: beside such a leaf, and of an opening that is not filled
_MAX_HIDDEN, _MAX_HIDDEN_CLOSED = 0.6, 0.5
_FILLED, _MIN_FILLED = 0.75, 0.2  # flush, of the free share and of all: of a filled opening
_MIN_IN_VIEW_FILLED = 0.5  # of all cells
_BLOCKED = 0.5  # on the wall: blocked, if nothing else confirms that the door is open
_MAX_FLUSH, _MIN_FREE = (
    0.5,
    0.2,
)  # flush beside a seen leaf, of the free share or, if that is smaller, of the second
_CROSSED = 0.05  # through: of an opening that is not closed
_CLEAR, _MAX_LOST = 0.9, 0.05  # through, of the free share, and missing: sight lines pass everywhere
_MIN_SPACE = 0.35  # on the wall but not flush, or through: bounds of an opening that is seen along the wall
_GLASS = 0.05  # through: seen through, although little came back
# Shares of the rays to the floor behind an opening.
_RETURNED = 0.95  # came back: few do from a dark leaf
_MIN_SEEN_FLOOR = 0.9  # came back, where they pass
_NO_FLOOR = 0.2  # of the sight lines expected on that floor, ended behind the wall
_WHOLE_LEAF = 0.95  # of the cells in view of a leaf of an opening that nothing crosses
_MIN_OPEN_DEG = 65.0  # doors are called open from 75 degrees on, semi-open up to 65
_NEAR_RATIO, _NEAR_M = 1.25, 1.0  # of the surroundings of a hole to the least range of the cloud, and at most
_FAR_RATIO, _FAR_M = 0.8, 4.0  # of the wall to the largest range, and at least: rooms end at walls


class DoorwayCheck(NamedTuple):
    """Result of a check of one door."""

    abstention: Abstention | None  # reason why its state is refused
    leaf_seen: bool | None = None  # of an open door; None where it was not checked


class DoorwayLimits(NamedTuple):
    """Limits of the check; `Gate` explains them."""

    max_missing_share: float
    min_floor_share: float
    free_reach_m: float


@dataclass(frozen=True, eq=False)
class _Case:
    """A door, what its doorway shows, and the points to look at."""

    view: MeasuredView
    door: Door
    doorway: Doorway
    evidence: DoorwayEvidence
    limits: DoorwayLimits

    @cached_property
    def floor_rays(self) -> FloorRays | None:
        """Rays to the floor behind the opening."""
        points, place = self.view.points, self.doorway
        opening = Opening.in_frame(place.x_m, place.y_m, place.yaw_deg, place.width_m)
        return floor_rays(points, np.ones(len(points), dtype=bool), opening, self.limits.free_reach_m)

    @property
    def passes(self) -> bool:
        """True if the floor behind the opening was measured, from the wall on: a pane shows its farther part only."""
        rays, least = self.floor_rays, self.limits.min_floor_share
        if rays is None or rays.seen < _MIN_SEEN_FLOOR:
            return False
        return rays.passed >= least or self.evidence.floor_behind >= least


def check_doorways(cloud: Points, doors: Sequence[Door], limits: DoorwayLimits) -> list[DoorwayCheck]:
    """Return for each door the reason against its state, or None, and whether the leaf of an open one was seen.

    Args:
        cloud: (N, 3) or organized (H, W, 3) metres, level sensor frame.
        doors: doors; one without a state is not checked.
        limits: limits.
    """
    if all(door.state is None for door in doors):
        return [DoorwayCheck(None)] * len(doors)
    points = thinned(cloud)
    view = MeasuredView(points[:: max(1, round(len(points) / _MAX_POINTS))])
    return [_check(view, door, limits) for door in doors]


def _check(view: MeasuredView, door: Door, limits: DoorwayLimits) -> DoorwayCheck:
    if door.state is None or len(view.points) == 0:
        return DoorwayCheck(None)
    floor_z_m = view.lowest_z_m if door.floor_z_m is None else door.floor_z_m
    doorway = Doorway(door.x_m, door.y_m, door.yaw_deg, door.width_m, floor_z_m)
    evidence = find_evidence(view, doorway)
    if evidence.in_view < _MIN_IN_VIEW:
        return DoorwayCheck(Abstention("door_out_of_view"))
    return _CHECKS[door.state](_Case(view, door, doorway, evidence, limits))


def _check_closed(case: _Case) -> DoorwayCheck:
    """Require a surface in the opening."""
    evidence = case.evidence
    if evidence.on_wall >= _MIN_SURFACE:
        return DoorwayCheck(None)
    return DoorwayCheck(_hidden(evidence, _MAX_HIDDEN_CLOSED) or _reason(evidence))


def _check_semi_open(case: _Case) -> DoorwayCheck:
    """Require a leaf, or a surface that is not flush with the wall or leaves a part of the opening free."""
    evidence = case.evidence
    is_askew = evidence.on_wall >= _MIN_SURFACE and evidence.flush < _MOSTLY_FLUSH * evidence.on_wall
    is_aside = evidence.flush >= _MIN_PART and evidence.through >= _MIN_THROUGH
    is_missing = evidence.missing > case.limits.max_missing_share
    if (is_askew or is_aside) and not is_missing:
        return DoorwayCheck(None)
    if sweep_leaf(case.view, case.doorway, SEMI_OPEN_ANGLES_DEG) is not None:
        return DoorwayCheck(None)
    if is_missing:
        return DoorwayCheck(_reason(evidence))
    return DoorwayCheck(_hidden(evidence, _MAX_HIDDEN) or Abstention("leaf_out_of_view"))


def _check_open(case: _Case) -> DoorwayCheck:
    """Require an opening that is not filled, and a leaf or the floor behind it; of double doors, behind one leaf."""
    leaf = _open_leaf(case)
    check = _check_passage(case, leaf)
    if check.abstention is None or case.doorway.width_m < 2 * MIN_WIDTH_M:
        return check
    halves = [
        _check_passage(half, leaf if leaf is not None and leaf.hinge == hinge else None)
        for hinge in ("left", "right")
        if (half := _half(case, hinge)).evidence.in_view >= _MIN_IN_VIEW
    ]
    passed = [half for half in halves if half.abstention is None]
    return max(passed, key=lambda half: bool(half.leaf_seen), default=check)


def _open_leaf(case: _Case) -> SeenLeaf | None:
    """Return the surface that has the place and the shape of an open leaf, or None."""
    leaf = sweep_leaf(case.view, case.doorway)
    angle_deg = None if leaf is None else find_leaf_angle_deg(case.view, case.doorway, leaf)
    return None if leaf is None or angle_deg is None or angle_deg < _MIN_OPEN_DEG else leaf


def _half(case: _Case, hinge: Hinge) -> _Case:
    """Return one half of a wide doorway."""
    doorway, yaw = case.doorway, math.radians(case.doorway.yaw_deg)
    shift_m = doorway.width_m / 4 * (1 if hinge == "left" else -1)
    half = replace(
        doorway,
        x_m=doorway.x_m + shift_m * math.cos(yaw),
        y_m=doorway.y_m + shift_m * math.sin(yaw),
        width_m=doorway.width_m / 2,
    )
    return replace(case, doorway=half, evidence=find_evidence(case.view, half))


def _check_passage(case: _Case, leaf: SeenLeaf | None) -> DoorwayCheck:
    """Require a leaf beside an opening that nothing fills, or else sight lines that pass or end on its bounds."""
    evidence, passes, rays = case.evidence, case.passes, case.floor_rays
    # A sliding leaf behind a thick wall lies so far behind its face that rays seem to pass.
    has_floor_behind = (
        evidence.floor_behind >= case.limits.min_floor_share
    )  # not if too few lines are expected
    if _is_filled(evidence) and not has_floor_behind:
        return DoorwayCheck(Abstention("opening_blocked", {"share": evidence.flush}))
    # Furniture before a closed or dark leaf may look like a part of a leaf; nothing passes it.
    is_crossed = passes or evidence.through >= _CROSSED or (rays is not None and rays.seen >= _RETURNED)
    is_leaf = leaf is not None and (is_crossed or leaf.share >= _WHOLE_LEAF)
    if is_leaf and evidence.flush <= _MAX_FLUSH * max(evidence.free, _MIN_FREE):
        return DoorwayCheck(None, leaf_seen=True)
    hidden = _hidden(evidence, _MAX_HIDDEN)
    if hidden is not None:
        return DoorwayCheck(hidden)
    if passes or _is_clear(evidence) or _has_space(evidence, rays, case.limits.max_missing_share):
        return DoorwayCheck(None, leaf_seen=False)
    if evidence.on_wall >= _BLOCKED:
        return DoorwayCheck(Abstention("opening_blocked", {"share": evidence.on_wall}))
    return DoorwayCheck(_reason(evidence))


def _is_filled(evidence: DoorwayEvidence) -> bool:
    """Return True if a surface along the wall fills what is seen of an opening."""
    is_surface = evidence.flush >= max(_MIN_FILLED, _FILLED * evidence.free)
    return is_surface and evidence.through < _MIN_THROUGH and evidence.in_view >= _MIN_IN_VIEW_FILLED


def _is_clear(evidence: DoorwayEvidence) -> bool:
    """Return True if sight lines pass everywhere, below and above any pane in a leaf."""
    return evidence.missing <= _MAX_LOST and evidence.through >= max(_CLEAR * evidence.free, _MIN_THROUGH)


def _has_space(evidence: DoorwayEvidence, rays: FloorRays | None, most_missing: float) -> bool:
    """Return True if sight lines end on what bounds an opening, as they do where it is seen along the wall.

    Things behind without their floor are seen through glass, but the floor may be out of view.
    """
    if evidence.floor_behind < _NO_FLOOR or evidence.missing > most_missing * (1 - evidence.across):
        return False
    return evidence.on_wall - evidence.flush + (evidence.through if rays is None else 0.0) >= _MIN_SPACE


def _hidden(evidence: DoorwayEvidence, most: float) -> Abstention | None:
    return Abstention("door_occluded", {"share": evidence.hidden}) if evidence.hidden > most else None


def _reason(evidence: DoorwayEvidence) -> Abstention:
    """Return why an opening was not measured."""
    missing = evidence.missing
    if evidence.hole_m <= min(_NEAR_M, _NEAR_RATIO * evidence.nearest_m):
        return Abstention("door_too_near", {"range_m": evidence.hole_m})
    if evidence.rim_m >= max(_FAR_M, _FAR_RATIO * evidence.farthest_m):
        return Abstention("door_out_of_range", {"range_m": evidence.rim_m})
    if evidence.through >= _GLASS:
        return Abstention("door_glass", {"share": evidence.through, "missing_share": missing})
    if not evidence.has_floor_before:
        return Abstention("door_not_measured", {"share": missing})
    return Abstention("door_dark", {"share": missing})


_CHECKS: dict[DoorState, Callable[[_Case], DoorwayCheck]] = {
    DoorState.CLOSED: _check_closed,
    DoorState.SEMI_OPEN: _check_semi_open,
    DoorState.OPEN: _check_open,
}
