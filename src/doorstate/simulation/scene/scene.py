# SPDX-License-Identifier: Apache-2.0
"""A whole scene: a wall with a door or another feature, the spaces on both sides, and clutter."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple, Self

from pydantic import Field, model_validator

from doorstate._models import FrozenModel
from doorstate.simulation.scene.box import Box, Pose
from doorstate.simulation.scene.clutter import Item, item_boxes
from doorstate.simulation.scene.door import Door, Opening
from doorstate.simulation.scene.door_boxes import door_boxes
from doorstate.simulation.scene.feature import Feature, feature_boxes
from doorstate.simulation.scene.placed_door import (
    PlacedDoor,
    neighbours,
    pierced_walls,
    placed_door_boxes,
)
from doorstate.simulation.scene.room import Space, ceiling_box, floor_box, space_boxes


class Scene(FrozenModel):
    """Everything in front of the camera except how far the door is open.

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

    @model_validator(mode="after")
    def _check_door_or_feature(self) -> Self:
        if (self.door is None) == (self.feature is None):
            raise ValueError("a scene has either a door or a feature")
        if self.feature and self.feature.kind == "cupboard" and not self.feature.fronts:
            raise ValueError("a cupboard has at least one front")
        return self

    @model_validator(mode="after")
    def _check_other_doors(self) -> Self:
        thickness_m: dict[str, float] = {"main": self.wall.wall_thickness_m}
        for placed in self.other_doors or ():
            if self.door is None:
                raise ValueError("further doors need a main door")
            placed.pose(self.near)
            door = placed.door
            if door.wall_height_m != self.door.wall_height_m:
                raise ValueError("walls of one room have the same height")
            if door.wall_thickness_m != thickness_m.setdefault(placed.wall, door.wall_thickness_m):
                raise ValueError("doors of one wall have walls of the same thickness")
        return self

    @property
    def wall(self) -> Door | Feature:
        """The door or feature, which holds the wall's thickness and height."""
        subject = self.door or self.feature
        assert subject is not None
        return subject


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
        main = door_boxes(scene.door, opening, neighbours(others))
    else:
        assert scene.feature is not None
        main = feature_boxes(scene.feature)
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
    """Return floor, ceiling and the walls of the spaces on both sides, with gaps for other doors."""
    wall, others = scene.wall, scene.other_doors or ()
    height = wall.wall_height_m
    return [
        floor_box(wall.floor_size_m),
        *([ceiling_box(height, wall.floor_size_m)] if scene.has_ceiling else []),
        *space_boxes(scene.near, 0.0, 1, height, without={placed.wall for placed in others}),
        *space_boxes(scene.far, -wall.wall_thickness_m, -1, height),
        *pierced_walls(others, scene.near),
    ]


def clutter_boxes(scene: Scene) -> list[Box]:
    """Return the boxes of all items."""
    return [box for item in scene.items for box in item_boxes(item)]
