# SPDX-License-Identifier: Apache-2.0
"""Floors that end with the spaces above them, with holes for stairs, and their ceilings."""

from __future__ import annotations

import math
from collections.abc import Sequence

from doorstate.simulation.scene.box import Box, Pose
from doorstate.simulation.scene.room import FLOOR_M, LONG_M, WALL_M, Space
from doorstate.types import Part


def floor_boxes(
    near: Space, behind: Sequence[tuple[Pose, Space, float]], holes: Sequence[Box], height_m: float | None
) -> list[Box]:
    """Return the floors of a room and of the spaces around it, then their ceilings.

    Args:
        near: the room.
        behind: for each space around it the frame of its door or aperture, the space, and the thickness of the wall.
        holes: holes in the floor.
        height_m: of the ceilings; None is none.
    """
    floors = _floor(near, 0.0, 1)
    for pose, space, thickness_m in behind:
        floors += pose.place(_floor(space, thickness_m, -1))
    ceilings = [] if height_m is None else [_above(floor, height_m) for floor in floors]
    for hole in holes:
        floors = [piece for floor in floors for piece in _without_hole(floor, hole)]
    return [*floors, *ceilings]


def _floor(space: Space, wall_thickness_m: float, side: int) -> list[Box]:
    """Return the floor of a space that begins at y = 0; behind a wall (side -1) it lies under the wall too."""
    if space.is_outdoors:
        return []
    left, right = space.left_m or LONG_M, space.right_m or LONG_M
    depth = (space.depth_m or LONG_M) + (wall_thickness_m if side < 0 else 0.0)
    center = ((left - right) / 2, side * depth / 2, -FLOOR_M / 2)
    return [Box(Part.FLOOR, center, (left + right, depth, FLOOR_M))]


def _above(floor: Box, height_m: float) -> Box:
    """Return the ceiling above a floor."""
    return floor._replace(
        part=Part.CEILING,
        center_m=(*floor.center_m[:2], height_m + WALL_M / 2),
        size_m=(*floor.size_m[:2], WALL_M),
    )


def _without_hole(floor: Box, hole: Box) -> list[Box]:
    """Return the up to four pieces of a floor around a hole; both lie along the axes."""
    (left, right), (front, back) = _ends(floor)
    (hole_left, hole_right), (hole_front, hole_back) = _ends(hole)
    inner = max(left, hole_left), min(right, hole_right)
    pieces = [
        ((left, right), (front, max(front, hole_front))),
        ((left, right), (min(back, hole_back), back)),
        ((left, max(left, hole_left)), (max(front, hole_front), min(back, hole_back))),
        ((min(right, hole_right), right), (max(front, hole_front), min(back, hole_back))),
    ]
    if inner[0] >= inner[1] or pieces[0][1][1] >= pieces[1][1][0]:
        return [floor]
    return [
        floor._replace(
            center_m=(sum(x) / 2, sum(y) / 2, floor.center_m[2]),
            size_m=(x[1] - x[0], y[1] - y[0], floor.size_m[2]),
            yaw_rad=0.0,
        )
        for x, y in pieces
        if x[1] > x[0] and y[1] > y[0]
    ]


def _ends(box: Box) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the ends along x and y of a box turned by a multiple of 90 degrees."""
    size = box.size_m[::-1][1:] if round(box.yaw_rad / (math.pi / 2)) % 2 else box.size_m[:2]
    (x_low, x_high), (y_low, y_high) = (
        (middle - side / 2, middle + side / 2) for middle, side in zip(box.center_m[:2], size, strict=True)
    )
    return (x_low, x_high), (y_low, y_high)
