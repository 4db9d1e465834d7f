# SPDX-License-Identifier: Apache-2.0
"""A whole scene: a wall with a door or another feature, the spaces on both sides, and clutter."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from doorstate._models import FrozenModel
from doorstate.simulation.scene.box import Box
from doorstate.simulation.scene.clutter import Item, item_boxes
from doorstate.simulation.scene.door import Door, Opening
from doorstate.simulation.scene.door_boxes import door_boxes
from doorstate.simulation.scene.feature import Feature, feature_boxes
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

    @model_validator(mode="after")
    def _check_door_or_feature(self) -> Self:
        if (self.door is None) == (self.feature is None):
            raise ValueError("a scene has either a door or a feature")
        if self.feature and self.feature.kind == "cupboard" and not self.feature.fronts:
            raise ValueError("a cupboard has at least one front")
        return self

    @property
    def wall(self) -> Door | Feature:
        """The door or feature, which holds the wall's thickness and height."""
        subject = self.door or self.feature
        assert subject is not None
        return subject


def scene_boxes(scene: Scene, opening: Opening) -> list[Box]:
    """Return all boxes in the door frame: first the door or feature, then the rooms, last the clutter."""
    if scene.door:
        boxes = door_boxes(scene.door, opening)
    else:
        assert scene.feature is not None
        boxes = feature_boxes(scene.feature)
    return [*boxes, *room_boxes(scene), *clutter_boxes(scene)]


def room_boxes(scene: Scene) -> list[Box]:
    """Return floor, ceiling and the walls of the spaces on both sides."""
    wall = scene.wall
    height = wall.wall_height_m
    return [
        floor_box(wall.floor_size_m),
        *([ceiling_box(height, wall.floor_size_m)] if scene.has_ceiling else []),
        *space_boxes(scene.near, 0.0, 1, height),
        *space_boxes(scene.far, -wall.wall_thickness_m, -1, height),
    ]


def clutter_boxes(scene: Scene) -> list[Box]:
    """Return the boxes of all items."""
    return [box for item in scene.items for box in item_boxes(item)]
