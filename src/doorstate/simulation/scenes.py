# SPDX-License-Identifier: Apache-2.0
"""A scene: a wall with a door or with something else, the spaces on both sides of it, and what stands there."""

from __future__ import annotations

from typing import Self

from pydantic import model_validator

from doorstate._models import FrozenModel
from doorstate.simulation.clutter import Item, item_boxes
from doorstate.simulation.doors import Opening, VariedDoor, door_boxes
from doorstate.simulation.no_door import Feature, feature_boxes
from doorstate.simulation.rooms import Space, ceiling_box, space_boxes
from doorstate.simulation.scene import Box, floor_box


class Scene(FrozenModel):
    """Everything but the camera and how far the door is open."""

    door: VariedDoor | None = None
    feature: Feature | None = None  # what is there instead of a door
    near: Space
    far: Space
    items: tuple[Item, ...] = ()

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        if (self.door is None) == (self.feature is None):
            raise ValueError("a scene has either a door or a feature")
        return self

    @property
    def wall(self) -> VariedDoor | Feature:
        """What says how thick and high the wall is."""
        subject = self.door or self.feature
        assert subject is not None
        return subject


def scene_boxes(scene: Scene, opening: Opening) -> list[Box]:
    """All boxes in the door frame (scene.py): the door or feature, the spaces, and last what stands there."""
    if scene.door:
        boxes = door_boxes(scene.door, opening)
    else:
        assert scene.feature is not None
        boxes = feature_boxes(scene.feature)
    return [*boxes, *room_boxes(scene), *clutter_boxes(scene)]


def room_boxes(scene: Scene) -> list[Box]:
    """Floor, ceiling and the walls of the spaces before and behind the wall."""
    wall = scene.wall
    height = wall.wall_height_m
    return [
        floor_box(wall.floor_size_m),
        ceiling_box(height, wall.floor_size_m),
        *space_boxes(scene.near, 0.0, 1, height),
        *space_boxes(scene.far, -wall.wall_thickness_m, -1, height),
    ]


def clutter_boxes(scene: Scene) -> list[Box]:
    """What stands there."""
    return [box for item in scene.items for box in item_boxes(item)]
