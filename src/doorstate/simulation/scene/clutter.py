# SPDX-License-Identifier: Apache-2.0
"""Clutter in front of a door: furniture and people, each built of a few boxes."""

from __future__ import annotations

import math
from typing import Literal

from doorstate._models import Degrees, FrozenModel, Metres
from doorstate.simulation.scene.box import Box, place
from doorstate.types import Part

ItemKind = Literal["chair", "table", "cabinet", "bin", "plant", "person", "carton"]

_LEG_M, _TOP_M = 0.04, 0.04


class Item(FrozenModel):
    """A piece of clutter: position of its middle in the door frame, and size."""

    kind: ItemKind
    x_m: Metres
    y_m: Metres
    yaw_deg: Degrees
    width_m: Metres
    depth_m: Metres
    height_m: Metres


def item_boxes(item: Item) -> list[Box]:
    """Return the boxes of an item in the door frame, standing on the floor."""
    if item.kind in ("chair", "table"):
        boxes = _on_legs(item)
    elif item.kind == "person":
        boxes = _person(item)
    elif item.kind == "plant":
        pot = 0.35 * item.height_m
        boxes = [
            _block(0.6 * item.width_m, 0.6 * item.depth_m, 0.0, pot),
            _block(item.width_m, item.depth_m, pot, item.height_m),
        ]
    else:
        boxes = [_block(item.width_m, item.depth_m, 0.0, item.height_m)]
    return place(boxes, item.x_m, item.y_m, math.radians(item.yaw_deg))


def _block(width: float, depth: float, bottom: float, top: float, x: float = 0.0, y: float = 0.0) -> Box:
    return Box(Part.OTHER, (x, y, (bottom + top) / 2), (width, depth, top - bottom))


def _on_legs(item: Item) -> list[Box]:
    seat = 0.45 if item.kind == "chair" else item.height_m
    width, depth = item.width_m, item.depth_m
    x, y = (width - _LEG_M) / 2, (depth - _LEG_M) / 2
    legs = [_block(_LEG_M, _LEG_M, 0.0, seat - _TOP_M, a * x, b * y) for a in (-1, 1) for b in (-1, 1)]
    boxes = [*legs, _block(width, depth, seat - _TOP_M, seat)]
    if item.kind == "chair":
        boxes.append(_block(width, _TOP_M, seat, item.height_m, 0.0, (depth - _TOP_M) / 2))
    return boxes


def _person(item: Item) -> list[Box]:
    hip, neck = 0.48 * item.height_m, 0.85 * item.height_m
    return [
        _block(0.7 * item.width_m, 0.7 * item.depth_m, 0.0, hip),
        _block(item.width_m, item.depth_m, hip, neck),
        _block(0.18, 0.20, neck, item.height_m),
    ]
