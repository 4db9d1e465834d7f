# SPDX-License-Identifier: Apache-2.0
"""Rooms before and behind a wall: side walls, a far wall, floor and ceiling."""

from __future__ import annotations

from collections.abc import Collection

from doorstate._models import FrozenModel, Metres
from doorstate.simulation.scene.box import Box
from doorstate.types import Part

WALL_M = 0.1
FLOOR_M = 0.1
LONG_M = 8.0  # length of walls without an end: beyond the camera's range


class Space(FrozenModel):
    """Distances from the middle of the door or feature to the inner faces of the room's walls; None is open."""

    left_m: Metres | None = None
    right_m: Metres | None = None
    depth_m: Metres | None = None
    is_outdoors: bool | None = None  # nothing within a camera's range, without floor


OUTDOORS = Space(is_outdoors=True)


def space_boxes(
    space: Space, wall_y_m: float, side: int, height_m: float, without: Collection[str] = ()
) -> list[Box]:
    """Return the walls of a space that begins at the wall face `wall_y_m`, towards +y (side 1) or -y (side -1).

    Args:
        space: distances of the walls.
        wall_y_m: y of the face.
        side: direction of the space.
        height_m: height of its walls.
        without: walls to leave out, of `left`, `opposite` and `right`.
    """
    depth = space.depth_m or LONG_M
    left, right = space.left_m or LONG_M, space.right_m or LONG_M
    middle_y, z = wall_y_m + side * depth / 2, height_m / 2
    boxes = []
    if space.left_m and "left" not in without:
        boxes.append(Box(Part.WALL, (left + WALL_M / 2, middle_y, z), (WALL_M, depth, height_m)))
    if space.right_m and "right" not in without:
        boxes.append(Box(Part.WALL, (-right - WALL_M / 2, middle_y, z), (WALL_M, depth, height_m)))
    if space.depth_m and "opposite" not in without:
        y = wall_y_m + side * (depth + WALL_M / 2)
        boxes.append(Box(Part.WALL, ((left - right) / 2, y, z), (left + right, WALL_M, height_m)))
    return boxes


def floor_box(size_m: float) -> Box:
    """Return a square floor."""
    return Box(Part.FLOOR, (0.0, 0.0, -FLOOR_M / 2), (size_m, size_m, FLOOR_M))


def ceiling_box(height_m: float, size_m: float) -> Box:
    """Return a square ceiling over both spaces."""
    return Box(Part.CEILING, (0.0, 0.0, height_m + WALL_M / 2), (size_m, size_m, WALL_M))
