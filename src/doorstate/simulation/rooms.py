# SPDX-License-Identifier: Apache-2.0
"""The spaces before and behind a wall: side walls, a far wall, or neither."""

from __future__ import annotations

from doorstate._models import FrozenModel
from doorstate.simulation.draws import Draws
from doorstate.simulation.scene import Box
from doorstate.types import Part

_WALL_M = 0.1
_LONG_M = 8.0  # how far walls go that end nowhere: farther than the camera sees
_BESIDE_M = 0.15  # from what is in the wall to a side wall, at least
_AROUND_ROBOT_M = 0.45


class Space(FrozenModel):
    """Distances from the middle of the door (or of what is there instead) to the inner faces; None is open."""

    left_m: float | None = None
    right_m: float | None = None
    depth_m: float | None = None


def space_boxes(space: Space, wall_y_m: float, side: int, height_m: float) -> list[Box]:
    """Walls of the space that begins at the wall's face `wall_y_m` and lies on its side of +y (1) or -y (-1)."""
    depth = space.depth_m or _LONG_M
    left, right = space.left_m or _LONG_M, space.right_m or _LONG_M
    middle_y, z = wall_y_m + side * depth / 2, height_m / 2
    boxes = []
    if space.left_m:
        boxes.append(Box(Part.WALL, (left + _WALL_M / 2, middle_y, z), (_WALL_M, depth, height_m)))
    if space.right_m:
        boxes.append(Box(Part.WALL, (-right - _WALL_M / 2, middle_y, z), (_WALL_M, depth, height_m)))
    if space.depth_m:
        y = wall_y_m + side * (depth + _WALL_M / 2)
        boxes.append(Box(Part.WALL, ((left - right) / 2, y, z), (left + right, _WALL_M, height_m)))
    return boxes


def ceiling_box(height_m: float, size_m: float) -> Box:
    """A ceiling over everything."""
    return Box(Part.CEILING, (0.0, 0.0, height_m + _WALL_M / 2), (size_m, size_m, _WALL_M))


def draw_near(draws: Draws, half_width_m: float, robot_x_m: float, robot_y_m: float) -> Space:
    """A hall (25 %), a corridor along the wall (30 %) or a room (45 %), all with space for the robot."""
    kind = draws.one_of({"hall": 0.25, "corridor": 0.30, "room": 0.45})
    if kind == "hall":
        return Space()
    depth = robot_y_m + _AROUND_ROBOT_M + draws.between(0.0, 0.8 if kind == "corridor" else 2.5)
    if kind == "corridor":
        return Space(depth_m=round(depth, 4))
    beside = half_width_m + _BESIDE_M
    left = max(beside, robot_x_m + _AROUND_ROBOT_M) + draws.between(0.0, 2.0)
    right = max(beside, -robot_x_m + _AROUND_ROBOT_M) + draws.between(0.0, 2.0)
    return Space(left_m=round(left, 4), right_m=round(right, 4), depth_m=round(depth, 4))


def draw_far(draws: Draws, half_width_m: float) -> Space:
    """Nothing (25 %), or a room 1.5 to 6 m deep with side walls (50 %) or a corridor as wide (25 %)."""
    kind = draws.one_of({"nothing": 0.25, "corridor": 0.25, "room": 0.50})
    if kind == "nothing":
        return Space()
    depth = draws.between(1.5, 6.0)
    if kind == "corridor":
        return Space(depth_m=depth)
    sides = (round(half_width_m + _BESIDE_M + draws.between(0.0, 2.5), 4) for _ in range(2))
    return Space(left_m=next(sides), right_m=next(sides), depth_m=depth)
