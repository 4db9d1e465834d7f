# SPDX-License-Identifier: Apache-2.0
"""Further doors in the walls of the main door's room."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

from doorstate._models import FrozenModel, Metres
from doorstate.simulation.scene.box import Box, Pose
from doorstate.simulation.scene.door import Door, Opening
from doorstate.simulation.scene.door_boxes import frame_and_leaf_boxes
from doorstate.simulation.scene.room import LONG_M, Space, space_boxes
from doorstate.simulation.scene.wall import Gap, door_gap, wall_boxes

WallName = Literal["main", "left", "opposite", "right"]
"""Wall of a room, as seen by a robot that looks at the main door: `main` is the wall of that door."""


class PlacedDoor(FrozenModel):
    """A door in a wall of the main door's room, and the space behind it.

    `along_m` is the x of its middle in the frame of its wall: as a door frame, and x = 0 (or y = 0 for side walls) is
    that of the main door's frame.
    """

    door: Door
    wall: WallName
    along_m: Metres
    far: Space = Space()

    def pose(self, near: Space) -> Pose:
        """Return the door's frame in the main door's frame.

        Args:
            near: room of both doors.

        Raises:
            ValueError: the room has no such wall.
        """
        return wall_pose(self.wall, near).after(Pose(self.along_m, 0.0, 0.0))


def wall_pose(wall: WallName, near: Space) -> Pose:
    """Return the frame of a wall in the main door's frame.

    Raises:
        ValueError: the room has no such wall.
    """
    distance_m = {"main": 0.0, "left": near.left_m, "opposite": near.depth_m, "right": near.right_m}[wall]
    if distance_m is None:
        raise ValueError(f"a door in the {wall} wall of a room without such a wall")
    match wall:
        case "left":
            return Pose(distance_m, 0.0, math.pi / 2)
        case "opposite":
            return Pose(0.0, distance_m, math.pi)
        case "right":
            return Pose(-distance_m, 0.0, -math.pi / 2)
        case _:
            return Pose(0.0, 0.0, 0.0)


def neighbours(doors: Sequence[PlacedDoor], wall: WallName = "main") -> list[Gap]:
    """Return the gaps of the doors in one wall."""
    return [door_gap(placed.door, placed.along_m) for placed in doors if placed.wall == wall]


def placed_door_boxes(placed: PlacedDoor, opening: Opening, near: Space) -> list[Box]:
    """Return frame and leaves of a door in the main door's frame."""
    return placed.pose(near).place(frame_and_leaf_boxes(placed.door, opening))


class WallGap(NamedTuple):
    """A gap without a door in a wall."""

    wall: WallName
    wall_thickness_m: float
    gap: Gap


def pierced_walls(
    doors: Sequence[PlacedDoor], near: Space, height_m: float, more: Sequence[WallGap] = ()
) -> list[Box]:
    """Return the walls with gaps, without that of the main door, and the spaces behind all doors."""
    boxes = []
    depth, left, right = near.depth_m or LONG_M, near.left_m or LONG_M, near.right_m or LONG_M
    ends: dict[WallName, tuple[float, float]] = {
        "left": (0.0, depth),
        "opposite": (-left, right),
        "right": (-depth, 0.0),
    }
    for wall, ends_m in ends.items():
        gaps = [*neighbours(doors, wall), *(other.gap for other in more if other.wall == wall)]
        if gaps:
            thicknesses_m = [placed.door.wall_thickness_m for placed in doors if placed.wall == wall]
            thicknesses_m += [other.wall_thickness_m for other in more if other.wall == wall]
            boxes += wall_pose(wall, near).place(wall_boxes(ends_m, thicknesses_m[0], height_m, gaps))
    for placed in doors:
        far = space_boxes(placed.far, -placed.door.wall_thickness_m, -1, placed.door.wall_height_m)
        boxes += placed.pose(near).place(far)
    return boxes
