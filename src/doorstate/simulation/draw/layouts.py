# SPDX-License-Identifier: Apache-2.0
"""Rectangular rooms with doors in their walls, from above, before one door is chosen as the main door."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from doorstate.simulation.draw.rooms import BESIDE_M, draw_far
from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.draw.viewpoints import Viewpoint
from doorstate.simulation.scene.box import Pose
from doorstate.simulation.scene.door import Door
from doorstate.simulation.scene.placed_door import PlacedDoor, WallName
from doorstate.simulation.scene.room import Space
from doorstate.simulation.scene.scene import Scene

_PARTITION_M = 0.1  # between the rooms behind two doors of one wall
_ROLES: tuple[WallName, ...] = (
    "main",
    "left",
    "opposite",
    "right",
)  # of a wall, counted from the main door's


class WallDoor(NamedTuple):
    """A door and the wall it is in; `along_m` is the distance of its middle from the wall's first corner."""

    wall: int
    along_m: float
    door: Door
    far: Space = Space()

    @property
    def half_m(self) -> float:
        """Half of the width that the door needs in its wall."""
        return self.door.half_width_m + BESIDE_M


class Layout(NamedTuple):
    """A room with its first corner in the origin; walls are numbered counter-clockwise from the one along x.

    A wall that is missing leaves the room open.
    """

    length_m: float
    width_m: float
    has_wall: tuple[bool, bool, bool, bool]
    doors: tuple[WallDoor, ...] = ()

    def wall_length_m(self, wall: int) -> float:
        """Return the length of a wall."""
        return self.width_m if wall % 2 else self.length_m

    def wall_frame(self, wall: int) -> Pose:
        """Return the frame of a wall: origin in its first corner, x along it, y into the room."""
        corners = ((0.0, 0.0), (self.length_m, 0.0), (self.length_m, self.width_m), (0.0, self.width_m))
        return Pose(*corners[wall], wall * math.pi / 2)

    def door_frame(self, number: int) -> Pose:
        """Return the frame of a door."""
        placed = self.doors[number]
        return self.wall_frame(placed.wall).after(Pose(placed.along_m, 0.0, 0.0))

    def fits(self, candidate: WallDoor) -> bool:
        """Return True if a door has space in its wall beside corners and other doors."""
        half = candidate.half_m
        in_wall = half <= candidate.along_m <= self.wall_length_m(candidate.wall) - half
        return in_wall and all(
            abs(other.along_m - candidate.along_m) >= other.half_m + half + _PARTITION_M
            for other in self.doors
            if other.wall == candidate.wall
        )

    def scene(self, main: int) -> Scene:
        """Return the scene in the frame of one door."""
        door = self.doors[main]
        others = []
        for number, other in enumerate(self.doors):
            if number != main:
                wall, along_m = self.seen_from(door.wall, door.along_m, other.wall, other.along_m)
                others.append(PlacedDoor(door=other.door, wall=wall, along_m=along_m, far=other.far))
        near = self.near(door.wall, door.along_m)
        return Scene(door=door.door, near=near, far=door.far, other_doors=tuple(others))

    def near(self, wall: int, along_m: float) -> Space:
        """Return the room as seen from a place on a wall."""
        length = self.wall_length_m(wall)
        left, opposite, right = (self.has_wall[(wall + turn) % 4] for turn in (1, 2, 3))
        return Space(
            left_m=round(length - along_m, 4) if left else None,
            right_m=round(along_m, 4) if right else None,
            depth_m=round(self.wall_length_m(wall + 1), 4) if opposite else None,
        )

    def seen_from(
        self, wall: int, along_m: float, other_wall: int, other_along_m: float
    ) -> tuple[WallName, float]:
        """Return wall and coordinate along it of another place, in the frame of a place on a wall."""
        # Coordinate along each wall, by its role, that has zero where the frame has.
        zero_m = (along_m, 0.0, self.wall_length_m(wall) - along_m, self.wall_length_m(wall + 1))
        role = (other_wall - wall) % 4
        return _ROLES[role], round(other_along_m - zero_m[role], 4)


class PlacedCamera(NamedTuple):
    """A camera in a layout."""

    pose: Pose
    height_m: float
    pitch_deg: float
    roll_deg: float

    def viewpoint(self, frame: Pose) -> Viewpoint:
        """Return the camera in the frame of a door."""
        x, y, yaw = frame.inverse().after(self.pose)
        heading = math.degrees(math.remainder(yaw, 2 * math.pi))
        robot_angle = math.degrees(math.atan2(y, x))
        return Viewpoint(
            x_m=x,
            y_m=y,
            camera_height_m=self.height_m,
            heading_deg=heading,
            heading_rad=math.radians(heading),
            heading_offset_deg=math.remainder(heading - robot_angle - 180, 360),
            pitch_deg=self.pitch_deg,
            roll_deg=self.roll_deg,
            distance_m=math.hypot(x, y),
            robot_angle_deg=robot_angle,
        )


def draw_far_spaces(stream: Stream, layout: Layout) -> Layout:
    """Draw the space behind each door: open, a corridor, or rooms that end where that of the next door begins."""
    spaces: dict[int, Space] = {}
    for wall in range(4):
        numbers = [number for number, door in enumerate(layout.doors) if door.wall == wall]
        numbers.sort(key=lambda number: layout.doors[number].along_m)
        doors = [layout.doors[number] for number in numbers]
        if len(doors) == 1:
            spaces[numbers[0]] = draw_far(stream, doors[0].door.half_width_m)
        elif doors:
            spaces |= zip(numbers, _draw_row_of_spaces(stream, doors), strict=True)
    return layout._replace(
        doors=tuple(door._replace(far=spaces[number]) for number, door in enumerate(layout.doors))
    )


def _draw_row_of_spaces(stream: Stream, doors: Sequence[WallDoor]) -> list[Space]:
    kind = stream.choice({"nothing": 0.25, "corridor": 0.25, "rooms": 0.50})
    if kind != "rooms":
        shared = Space(depth_m=stream.uniform(1.5, 6.0)) if kind == "corridor" else Space()
        return [shared, *(Space() for _ in doors[1:])]
    ends_m = [
        -math.inf,
        *((a.along_m + b.along_m) / 2 for a, b in pairwise(doors)),
        math.inf,
    ]
    spaces = []
    for door, (low, high) in zip(doors, pairwise(ends_m), strict=True):
        right, left = (
            min(door.half_m + stream.uniform(0.0, 2.5), distance - _PARTITION_M / 2)
            for distance in (door.along_m - low, high - door.along_m)
        )
        spaces.append(Space(left_m=round(left, 4), right_m=round(right, 4), depth_m=stream.uniform(1.5, 6.0)))
    return spaces
