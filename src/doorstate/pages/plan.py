# SPDX-License-Identifier: Apache-2.0
"""Doors, walls and robot from above, in metres: what every drawing of a plan shows."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.doorways.finder import thinned
from doorstate.doorways.walls import find_walls, occupied_cells
from doorstate.inference.door import Door
from doorstate.inference.door_lines import SWING_DEG, LeafPlan
from doorstate.inference.prediction import Prediction
from doorstate.types import DoorState, Points

Place = tuple[float, float]
"""x forward and y left of the camera, metres."""
Segment = tuple[Place, Place]

STUB_M = 0.45  # of wall beside a door where no walls are known
_UPRIGHT_M = (0.15, 2.2)  # heights above the floor
_MIN_WALL_M, _MIN_HEIGHT_M = 0.25, 1.0
_NEAR_CELL_M, _MAX_HOLE_M = 0.06, 0.25  # of cells from their wall, and between cells of one stretch
_BEYOND_M = 1.0  # of the farthest door: walls end there
_NEAR_LEAF_M, _NEAR_LEAF_DEG = 0.25, 25.0  # a stretch from about the hinge, about along a leaf, is the leaf
_NEAR_WALL_M, _NEAR_WALL_DEG = 0.3, 20.0  # of a door in a wall
_USUAL_REACH_M = 4.0
_ARC_STEPS = 12


class PlanDoor(NamedTuple):
    """One door of a plan.

    Attributes:
        left_m, right_m: ends of the opening.
        middle_m: between them.
        label: name or number.
        state: name of the state, or `abstained`.
        distance_m: from the camera.
        angle_deg: opening angle; None without one.
        hinge_m, tip_m: ends of the leaf; None where they are not known.
        swing_m: places that the leaf's tip takes from shut to open.
    """

    left_m: Place
    right_m: Place
    middle_m: Place
    label: str
    state: str
    distance_m: float
    angle_deg: float | None = None
    hinge_m: Place | None = None
    tip_m: Place | None = None
    swing_m: tuple[Place, ...] = ()

    @property
    def outward(self) -> Place:
        """Unit vector across the wall, away from the camera."""
        along = self.left_m[0] - self.right_m[0], self.left_m[1] - self.right_m[1]
        length = math.hypot(*along) or 1.0
        return along[1] / length, -along[0] / length


@dataclass(frozen=True)
class Plan:
    """Doors of one cloud from above, in the level sensor frame; the robot is at the origin and looks along x.

    Attributes:
        doors: doors, the one of the answer first.
        walls: stretches of wall, without the openings of the doors.
        view_deg: bearings of the edges of the view, right and left; None where they are not known.
    """

    doors: tuple[PlanDoor, ...] = ()
    walls: tuple[Segment, ...] = ()
    view_deg: tuple[float, float] | None = None

    @property
    def places(self) -> list[Place]:
        """All places that a drawing must hold."""
        found: list[Place] = [(0.0, 0.0)]
        for door in self.doors:
            found += [door.left_m, door.right_m, *door.swing_m]
        for wall in self.walls:
            found += wall
        return found


def make_plan(
    prediction: Prediction,
    names: Sequence[str | None] = (),
    walls: Sequence[Segment] = (),
    view_deg: tuple[float, float] | None = None,
) -> Plan:
    """Return the plan of a prediction.

    Args:
        prediction: prediction.
        names: name of each of its doors; None for one that has none. Without names, several doors are numbered.
        walls: stretches of wall (`plan_walls`); without any, each door gets a piece of wall on both sides.
        view_deg: bearings of the edges of the view, right and left.
    """
    doors = tuple(
        _plan_door(door, _label(number, names, len(prediction.doors)))
        for number, door in enumerate(prediction.doors)
    )
    reach_m = max((door.distance_m for door in doors), default=_USUAL_REACH_M - _BEYOND_M) + _BEYOND_M
    cut = (_within(wall, reach_m) for wall in walls)
    walls = [wall for wall in cut if wall is not None and not any(_is_leaf(wall, door) for door in doors)]
    stretches = list(walls)
    for door in doors:
        if not any(_is_in(door, wall) for wall in walls):
            stretches.append(_stub(door))
    pieces = [piece for wall in stretches for piece in _without_openings(wall, doors)]
    return Plan(doors, tuple(pieces), view_deg)


def plan_of_record(doors: Sequence[Mapping[str, Any]]) -> Plan:
    """Return the plan of doors as `prediction_to_dict` lists them, with their `name` where they have one."""
    found = [
        Door(
            record["x_m"],
            record["y_m"],
            record["yaw_deg"],
            record["width_m"],
            state=None if record["state"] is None else DoorState(record["state"]),
            hinge=record.get("hinge"),
            opening_angle_deg=record.get("opening_angle_deg"),
        )
        for record in doors
    ]
    names = [record.get("name") for record in doors]
    return make_plan(Prediction.from_doors(found, [], 0, 0.0), names if any(names) else ())


def plan_walls(points: Points, floor_z_m: float) -> list[Segment]:
    """Return the walls of a level cloud in plan view, in the level sensor frame.

    Args:
        points: (N, 3) or (H, W, 3) metres.
        floor_z_m: height of the floor.
    """
    flat = thinned(points)
    height_m = flat[:, 2] - floor_z_m
    upright = flat[(height_m > _UPRIGHT_M[0]) & (height_m < _UPRIGHT_M[1])].astype(np.float64)
    cells_m, heights_m = occupied_cells(upright)
    free = heights_m >= _MIN_HEIGHT_M
    segments: list[Segment] = []
    for wall in find_walls(upright):
        on_wall = free & (np.abs(wall.line.behind_m(cells_m)) <= _NEAR_CELL_M)
        free &= ~on_wall
        along_m = np.sort(wall.line.along_m(cells_m[on_wall]))
        for run in np.split(along_m, np.flatnonzero(np.diff(along_m) > _MAX_HOLE_M) + 1):
            if len(run) and run[-1] - run[0] >= _MIN_WALL_M:
                segments.append((_place(wall.line.at(float(run[0]))), _place(wall.line.at(float(run[-1])))))
    return segments


def _label(number: int, names: Sequence[str | None], count: int) -> str:
    if names:
        return names[number] or "?"
    return str(number + 1) if count > 1 else ""


def _plan_door(door: Door, label: str) -> PlanDoor:
    left, right = door.opening
    plan = PlanDoor(left, right, (door.x_m, door.y_m), label, door.label, door.distance_m)
    leaf, angle_deg = LeafPlan.of(door), door.opening_angle_deg
    if leaf is None or angle_deg is None or door.state is None:
        return plan
    angles = np.linspace(0.0, max(SWING_DEG, angle_deg), _ARC_STEPS)
    return plan._replace(
        angle_deg=angle_deg,
        hinge_m=_place(leaf.hinge_m),
        tip_m=_place(leaf.at(door.width_m, angle_deg)),
        swing_m=tuple(_place(leaf.at(door.width_m, angle)) for angle in angles),
    )


def _place(point: NDArray[np.float64]) -> Place:
    return float(point[0]), float(point[1])


def _within(wall: Segment, reach_m: float) -> Segment | None:
    """Return the part of a stretch that is so near to the camera."""
    start, end = np.array(wall[0]), np.array(wall[1])
    length_m = float(np.hypot(*(end - start)))
    along = (end - start) / max(1e-9, length_m)
    foot_m = float(-start @ along)
    half_m2 = reach_m**2 - float(start @ start) + foot_m**2
    if half_m2 <= 0:
        return None
    first_m, last_m = max(0.0, foot_m - math.sqrt(half_m2)), min(length_m, foot_m + math.sqrt(half_m2))
    if last_m - first_m < _MIN_WALL_M:
        return None
    return _place(start + first_m * along), _place(start + last_m * along)


def _is_leaf(wall: Segment, door: PlanDoor) -> bool:
    """Return True for a stretch that lies along the open leaf of a door."""
    if door.hinge_m is None or door.tip_m is None or door.state == "closed":
        return False
    hinge, leaf = np.array(door.hinge_m), np.array(door.tip_m) - np.array(door.hinge_m)
    ends = sorted((np.array(end) for end in wall), key=lambda end: float(np.hypot(*(end - hinge))))
    near, far = ends
    stretch, width_m = far - near, float(np.hypot(*leaf))
    length_m = max(1e-9, float(np.hypot(*stretch)))
    sine = abs(float(leaf[0] * stretch[1] - leaf[1] * stretch[0])) / (width_m * length_m)
    is_along = sine <= math.sin(math.radians(_NEAR_LEAF_DEG)) and float(leaf @ stretch) > 0
    reaches_m = float(np.hypot(*(near - hinge))), float(np.hypot(*(far - hinge)))
    return is_along and reaches_m[0] <= _NEAR_LEAF_M + width_m / 2 and reaches_m[1] <= width_m + _NEAR_LEAF_M


def _stub(door: PlanDoor) -> Segment:
    (left_x, left_y), (right_x, right_y) = door.left_m, door.right_m
    length = math.hypot(left_x - right_x, left_y - right_y) or 1.0
    x, y = STUB_M * (left_x - right_x) / length, STUB_M * (left_y - right_y) / length
    return (right_x - x, right_y - y), (left_x + x, left_y + y)


def _is_in(door: PlanDoor, wall: Segment) -> bool:
    """Return True if a door lies in a stretch of wall."""
    first, last = _span(door, wall)
    start, end = np.array(wall[0]), np.array(wall[1])
    along = (end - start) / max(1e-9, float(np.hypot(*(end - start))))
    gap = np.array(door.middle_m) - start
    across_m = abs(float(along[0] * gap[1] - along[1] * gap[0]))
    opening = np.array(door.left_m) - np.array(door.right_m)
    sine = abs(float(along[0] * opening[1] - along[1] * opening[0])) / max(1e-9, float(np.hypot(*opening)))
    is_along = sine <= math.sin(math.radians(_NEAR_WALL_DEG))
    length_m = float(np.hypot(*(end - start)))
    return across_m <= _NEAR_WALL_M and is_along and first < length_m and last > 0


def _span(door: PlanDoor, wall: Segment) -> tuple[float, float]:
    """Return where an opening begins and ends along a wall, in metres from its start."""
    start, end = np.array(wall[0]), np.array(wall[1])
    along = (end - start) / max(1e-9, float(np.hypot(*(end - start))))
    first, last = sorted(float((np.array(place) - start) @ along) for place in (door.left_m, door.right_m))
    return first, last


def _without_openings(wall: Segment, doors: Sequence[PlanDoor]) -> Iterator[Segment]:
    """Yield the parts of a wall beside the openings in it."""
    (x, y), (end_x, end_y) = wall
    length_m = math.hypot(end_x - x, end_y - y)
    gaps = sorted(_span(door, wall) for door in doors if _is_in(door, wall))
    at = 0.0
    for first, last in [*gaps, (length_m, length_m)]:
        if first - at > 0.02:
            yield (
                (x + at / length_m * (end_x - x), y + at / length_m * (end_y - y)),
                (x + first / length_m * (end_x - x), y + first / length_m * (end_y - y)),
            )
        at = max(at, last)
