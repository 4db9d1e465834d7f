# SPDX-License-Identifier: Apache-2.0
"""A whole scene: a wall with a door or another feature, the spaces on both sides, and what stands in them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import Literal, NamedTuple, Self

from pydantic import Field, model_validator

from doorstate._models import FrozenModel
from doorstate.simulation.scene.aperture import Aperture, ApertureKind, aperture_boxes
from doorstate.simulation.scene.box import Box, Pose
from doorstate.simulation.scene.clutter import Item, item_boxes
from doorstate.simulation.scene.door import Door, Opening
from doorstate.simulation.scene.door_boxes import door_boxes
from doorstate.simulation.scene.feature import Feature, FeatureKind, feature_boxes
from doorstate.simulation.scene.fixture import Fixture, FixtureKind, fixture_boxes
from doorstate.simulation.scene.floors import floor_boxes
from doorstate.simulation.scene.person import Person, person_boxes
from doorstate.simulation.scene.placed_door import (
    PlacedDoor,
    WallGap,
    neighbours,
    pierced_walls,
    placed_door_boxes,
)
from doorstate.simulation.scene.room import WALL_M, Space, ceiling_box, floor_box, space_boxes
from doorstate.simulation.scene.stairs import Stairs, stairs_boxes
from doorstate.simulation.scene.wall import Gap

BEYOND_RANGE_M = 12.0
LayoutKind = Literal["corridor", "room", "junction", "lobby", "stairwell"]
SceneKind = Literal["door"] | FeatureKind | FixtureKind | ApertureKind


class Scene(FrozenModel):
    """Everything in front of the camera except how far the door is open.

    A building has a `layout`, and its floors and ceilings end with its spaces; elsewhere they are one square.

    Raises:
        ValueError: both a door and a feature, or neither.
    """

    door: Door | None = None
    feature: Feature | None = None  # instead of a door
    near: Space = Space()  # on the robot's side of the wall
    far: Space = Space()
    has_ceiling: bool = True
    items: tuple[Item, ...] = Field(default=(), max_length=200)
    other_doors: tuple[PlacedDoor, ...] | None = Field(default=None, max_length=20)
    layout: LayoutKind | None = None
    shows: FixtureKind | ApertureKind | None = None  # what a view without a door is about
    apertures: tuple[Aperture, ...] | None = Field(default=None, max_length=20)
    fixtures: tuple[Fixture, ...] | None = Field(default=None, max_length=200)
    stairs: tuple[Stairs, ...] | None = Field(default=None, max_length=10)
    people: tuple[Person, ...] | None = Field(default=None, max_length=20)

    @model_validator(mode="after")
    def _check_door_or_feature(self) -> Self:
        if (self.door is None) == (self.feature is None):
            raise ValueError("a scene has either a door or a feature")
        if self.feature and self.feature.kind == "cupboard" and not self.feature.fronts:
            raise ValueError("a cupboard has at least one front")
        return self

    @model_validator(mode="after")
    def _check_walls(self) -> Self:
        thickness_m: dict[str, float] = {"main": self.wall.wall_thickness_m}
        for placed in self.other_doors or ():
            if self.door is None:
                raise ValueError("further doors need a main door")
            if placed.door.wall_height_m != self.door.wall_height_m:
                raise ValueError("walls of one room have the same height")
        gaps: list[tuple[PlacedDoor | Aperture, float]] = []
        gaps += [(placed, placed.door.wall_thickness_m) for placed in self.other_doors or ()]
        gaps += [(aperture, aperture.wall_thickness_m) for aperture in self.apertures or ()]
        for gap, wall_m in gaps:
            gap.pose(self.near)
            if wall_m != thickness_m.setdefault(gap.wall, wall_m):
                raise ValueError("doors and apertures of one wall have walls of the same thickness")
        return self

    @property
    def wall(self) -> Door | Feature:
        """The door or feature, which holds the wall's thickness and height."""
        subject = self.door or self.feature
        assert subject is not None
        return subject

    @property
    def kind(self) -> SceneKind:
        """Return `door`, or what a view without a door is about."""
        return "door" if self.feature is None else self.shows or self.feature.kind

    def main_gaps(self) -> list[Gap]:
        """Return the gaps in the wall of the main door or feature, without that door's own."""
        gaps = neighbours(self.other_doors or ())
        return gaps + [aperture.gap for aperture in self.apertures or () if aperture.wall == "main"]

    def main_ends_m(self) -> tuple[float, float] | None:
        """Return the ends along x of that wall in a building, where it ends with the room."""
        if self.layout is None:
            return None
        left, right = (side or BEYOND_RANGE_M for side in (self.near.left_m, self.near.right_m))
        return -right - WALL_M, left + WALL_M

    def without_clutter(self) -> Self:
        """Return the scene without items and people."""
        return self.model_copy(update={"items": (), "people": None})


class BoxGroups(NamedTuple):
    """Boxes of a scene in the door frame, in the order of `scene_boxes`."""

    main: list[Box]  # the door with its wall, or the feature
    room: list[Box]
    other_doors: list[list[Box]]  # frame and leaves of each
    clutter: list[Box]

    def all(self) -> list[Box]:
        """Return the boxes in one list."""
        return [*self.main, *self.room, *chain.from_iterable(self.other_doors), *self.clutter]

    def doors(self) -> list[range]:
        """Return the numbers of each door's boxes in the list, first those of the main door and its wall."""
        ranges = [range(len(self.main))]
        start = len(self.main) + len(self.room)
        for boxes in self.other_doors:
            ranges.append(range(start, start + len(boxes)))
            start += len(boxes)
        return ranges


def box_groups(scene: Scene, opening: Opening, other_openings: Sequence[Opening] = ()) -> BoxGroups:
    """Return all boxes: of the door or feature, the rooms, the other doors, and the clutter.

    Args:
        scene: scene.
        opening: opening of the main door.
        other_openings: one for each other door.
    """
    others = scene.other_doors or ()
    if scene.door:
        main = door_boxes(scene.door, opening, scene.main_gaps(), scene.main_ends_m())
    else:
        assert scene.feature is not None
        main = feature_boxes(scene.feature, scene.main_gaps(), scene.main_ends_m())
    other_boxes = [
        placed_door_boxes(placed, own, scene.near) for placed, own in zip(others, other_openings, strict=True)
    ]
    return BoxGroups(main, room_boxes(scene), other_boxes, clutter_boxes(scene))


def door_frames(scene: Scene) -> list[Pose]:
    """Return the frames of all doors in that of the main door, which comes first."""
    return [Pose(0.0, 0.0, 0.0), *(placed.pose(scene.near) for placed in scene.other_doors or ())]


def scene_boxes(scene: Scene, opening: Opening, other_openings: Sequence[Opening] = ()) -> list[Box]:
    """Return the boxes of `box_groups` in one list."""
    return box_groups(scene, opening, other_openings).all()


def room_boxes(scene: Scene) -> list[Box]:
    """Return floor, ceiling, the walls of all spaces with gaps for doors, and what is fastened to them."""
    wall, others, apertures = scene.wall, scene.other_doors or (), scene.apertures or ()
    height = wall.wall_height_m
    gaps = [WallGap(aperture.wall, aperture.wall_thickness_m, aperture.gap) for aperture in apertures]
    pierced = {*(placed.wall for placed in others), *(aperture.wall for aperture in apertures)}
    return [
        *_floors_and_ceilings(scene),
        *space_boxes(scene.near, 0.0, 1, height, without=pierced),
        *space_boxes(scene.far, -wall.wall_thickness_m, -1, height),
        *pierced_walls(others, scene.near, height, gaps),
        *chain.from_iterable(aperture_boxes(aperture, scene.near, height) for aperture in apertures),
        *chain.from_iterable(map(stairs_boxes, scene.stairs or ())),
        *chain.from_iterable(map(fixture_boxes, scene.fixtures or ())),
    ]


def clutter_boxes(scene: Scene) -> list[Box]:
    """Return the boxes of all items and people."""
    return [
        *chain.from_iterable(map(item_boxes, scene.items)),
        *chain.from_iterable(map(person_boxes, scene.people or ())),
    ]


def _floors_and_ceilings(scene: Scene) -> list[Box]:
    wall = scene.wall
    if scene.layout is None:
        ceiling = [ceiling_box(wall.wall_height_m, wall.floor_size_m)] if scene.has_ceiling else []
        return [floor_box(wall.floor_size_m), *ceiling]
    behind = [(Pose(0.0, 0.0, 0.0), scene.far, wall.wall_thickness_m)]
    behind += [
        (placed.pose(scene.near), placed.far, placed.door.wall_thickness_m)
        for placed in scene.other_doors or ()
    ]
    behind += [
        (aperture.pose(scene.near), aperture.beyond, aperture.wall_thickness_m)
        for aperture in scene.apertures or ()
    ]
    holes = [stairs.outline() for stairs in scene.stairs or () if stairs.rise_m < 0]
    return floor_boxes(scene.near, behind, holes, wall.wall_height_m if scene.has_ceiling else None)
