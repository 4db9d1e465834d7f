# SPDX-License-Identifier: Apache-2.0
"""Plans of a room in a building: walls with doors and apertures, and what stands in it.

Everything is in the frame of the layout, whose origin is the room's first corner, until a place on a wall is chosen.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeVar

from doorstate.simulation.draw.layouts import Layout, WallDoor
from doorstate.simulation.scene.aperture import Aperture, ApertureKind
from doorstate.simulation.scene.box import Box, Pose
from doorstate.simulation.scene.clutter import Item
from doorstate.simulation.scene.door import Opening
from doorstate.simulation.scene.feature import Feature
from doorstate.simulation.scene.fixture import Fixture, FixtureKind
from doorstate.simulation.scene.person import Person
from doorstate.simulation.scene.room import OUTDOORS
from doorstate.simulation.scene.scene import BoxGroups, LayoutKind, Scene, box_groups
from doorstate.simulation.scene.stairs import Stairs

Placed = TypeVar("Placed", Fixture, Item, Person, Stairs)
_BESIDE_APERTURE_M = 0.1


class WallAperture(NamedTuple):
    """An aperture in a wall; its `wall` and `along_m` are set when a place on a wall is chosen."""

    wall: int
    along_m: float
    aperture: Aperture

    @property
    def half_m(self) -> float:
        """Half of the width that the aperture needs in its wall."""
        return self.aperture.width_m / 2 + _BESIDE_APERTURE_M


class Place(NamedTuple):
    """A place on a wall: that of the main door, or the middle of a view without a door."""

    wall: int
    along_m: float


class Plan(NamedTuple):
    """A room with everything in it."""

    kind: LayoutKind
    layout: Layout
    thicknesses_m: tuple[float, float, float, float]  # of the walls
    height_m: float
    has_ceiling: bool = True
    apertures: tuple[WallAperture, ...] = ()
    stairs: tuple[Stairs, ...] = ()
    fixtures: tuple[Fixture, ...] = ()
    items: tuple[Item, ...] = ()
    people: tuple[Person, ...] = ()

    def openings(self, wall: int) -> list[WallDoor | WallAperture]:
        """Return doors and apertures of a wall in their order along it."""
        both: list[WallDoor | WallAperture] = [*self.layout.doors, *self.apertures]
        return sorted((one for one in both if one.wall == wall), key=lambda one: one.along_m)

    def fits(self, candidate: WallDoor | WallAperture, apart_m: float = 0.15) -> bool:
        """Return True if a door or aperture has space in its wall."""
        if not self.layout.has_wall[candidate.wall]:
            return False
        half, length = candidate.half_m, self.layout.wall_length_m(candidate.wall)
        return half <= candidate.along_m <= length - half and all(
            abs(other.along_m - candidate.along_m) >= other.half_m + half + apart_m
            for other in self.openings(candidate.wall)
        )

    def with_door(self, door: WallDoor) -> Plan:
        """Return the plan with one more door."""
        return self._replace(layout=self.layout._replace(doors=(*self.layout.doors, door)))

    def free_stretches(self, wall: int) -> list[tuple[float, float]]:
        """Return the ends of the stretches of a wall between doors, apertures and corners."""
        if not self.layout.has_wall[wall]:
            return []
        openings = self.openings(wall)
        lows = [0.0, *(one.along_m + _edge_m(one) for one in openings)]
        highs = [*(one.along_m - _edge_m(one) for one in openings), self.layout.wall_length_m(wall)]
        return [(low, high) for low, high in zip(lows, highs, strict=True) if high > low]

    def contains(self, x_m: float, y_m: float) -> bool:
        """Return True if a place is in the room."""
        return 0.0 < x_m < self.layout.length_m and 0.0 < y_m < self.layout.width_m

    def on_wall(self, wall: int, along_m: float) -> Pose:
        """Return the frame of a place on a wall."""
        return self.layout.wall_frame(wall).after(Pose(along_m, 0.0, 0.0))

    def scene(self, place: Place | int, shows: FixtureKind | ApertureKind | None = None) -> Scene:
        """Return the scene in the frame of a door, given by its number, or of another place on a wall."""
        if isinstance(place, int):
            door = self.layout.doors[place]
            wall, along_m, scene = door.wall, door.along_m, self.layout.scene(place)
        else:
            wall, along_m = place
            feature = Feature(
                kind="wall", wall_thickness_m=self.thicknesses_m[wall], wall_height_m=self.height_m
            )
            scene = Scene(feature=feature, near=self.layout.near(wall, along_m), far=OUTDOORS)
        frame = self.on_wall(wall, along_m)
        apertures = []
        for one in self.apertures:
            name, along = self.layout.seen_from(wall, along_m, one.wall, one.along_m)
            apertures.append(one.aperture.model_copy(update={"wall": name, "along_m": along}))
        return scene.model_copy(
            update={
                "layout": self.kind,
                "shows": shows,
                "has_ceiling": self.has_ceiling,
                "apertures": tuple(apertures) or None,
                "stairs": _moved(self.stairs, frame) or None,
                "fixtures": _moved(self.fixtures, frame) or None,
                "items": _moved(self.items, frame),
                "people": _moved(self.people, frame) or None,
            }
        )

    def box_groups(self, place: Place | int) -> BoxGroups:
        """Return the boxes with all doors closed, in the frame of the layout."""
        scene = self.scene(place)
        where = Place(*self.layout.doors[place][:2]) if isinstance(place, int) else place
        frame = self.on_wall(*where)
        groups = box_groups(scene, Opening(), [Opening()] * len(scene.other_doors or ()))
        return BoxGroups(
            frame.place(groups.main),
            frame.place(groups.room),
            [frame.place(boxes) for boxes in groups.other_doors],
            frame.place(groups.clutter),
        )


def turned(pose: Pose, frame: Pose) -> tuple[float, float, float]:
    """Return x, y and the turn in degrees of a pose in another frame, rounded so that rows stay short."""
    x_m, y_m, yaw_rad = frame.inverse().after(pose)
    return round(x_m, 4), round(y_m, 4), round(math.degrees(math.remainder(yaw_rad, 2 * math.pi)), 3)


def closed_door_boxes(groups: BoxGroups) -> list[list[Box]]:
    """Return the boxes of each door of a plan, first those of the first door and its wall."""
    return [groups.main, *groups.other_doors]


def _edge_m(opening: WallDoor | WallAperture) -> float:
    if isinstance(opening, WallDoor):
        return opening.door.half_width_m
    return opening.aperture.width_m / 2


def _moved(things: tuple[Placed, ...], frame: Pose) -> tuple[Placed, ...]:
    moved = []
    for thing in things:
        x_m, y_m, yaw_deg = turned(Pose(thing.x_m, thing.y_m, math.radians(thing.yaw_deg)), frame)
        moved.append(thing.model_copy(update={"x_m": x_m, "y_m": y_m, "yaw_deg": yaw_deg}))
    return tuple(moved)
