# SPDX-License-Identifier: Apache-2.0
"""Doors and measurements that several tests share."""

from __future__ import annotations

from doorstate.simulation.draw.doors import draw_door
from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene import Box, Door, Opening
from doorstate.simulation.scene.door_boxes import leaf_boxes
from doorstate.simulation.scene.handle import Handle
from doorstate.simulation.scene.plan import footprint

LEVER = Handle(kind="lever", height_m=1.0, projection_m=0.06, length_m=0.13)
DOORS = [draw_door(Stream(7, index, "doors")) for index in range(120)]
HINGED = [door for door in DOORS if not door.is_sliding]


def span(boxes: list[Box], axis: int) -> tuple[float, float]:
    """Return the extent of boxes along an axis."""
    if axis == 2:
        return (
            min(box.center_m[2] - box.size_m[2] / 2 for box in boxes),
            max(box.center_m[2] + box.size_m[2] / 2 for box in boxes),
        )
    values = [corner[axis] for box in boxes for corner in footprint(box)]
    return min(values), max(values)


def bare_leaves(door: Door, opening: Opening) -> list[Box]:
    """Return the leaves without handles."""
    return leaf_boxes(door.model_copy(update={"handle": None}), opening)
