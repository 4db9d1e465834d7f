# SPDX-License-Identifier: Apache-2.0
"""Things that stand before a door: furniture and people, each a few boxes."""

from __future__ import annotations

import math
from typing import Literal

from doorstate._models import FrozenModel
from doorstate.simulation.draws import Draws
from doorstate.simulation.plan import collide, place
from doorstate.simulation.rooms import Space
from doorstate.simulation.scene import Box
from doorstate.types import Part

ItemKind = Literal["chair", "table", "cabinet", "bin", "plant", "person", "carton"]

_BAND_M = 3.0  # beside the door and before it
# Width, depth and height in metres, each between two numbers.
_SIZES_M: dict[ItemKind, tuple[tuple[float, float], tuple[float, float], tuple[float, float]]] = {
    "chair": ((0.40, 0.50), (0.40, 0.50), (0.80, 1.00)),
    "table": ((0.80, 1.40), (0.60, 0.80), (0.70, 0.76)),
    "cabinet": ((0.40, 1.00), (0.35, 0.50), (0.70, 1.90)),
    "bin": ((0.25, 0.40), (0.25, 0.40), (0.30, 0.70)),
    "plant": ((0.30, 0.60), (0.30, 0.60), (0.60, 1.60)),
    "person": ((0.40, 0.50), (0.25, 0.35), (1.55, 1.90)),
    "carton": ((0.30, 0.60), (0.30, 0.60), (0.30, 0.90)),
}
_LEG_M, _TOP_M = 0.04, 0.04
_TRIES_AN_ITEM = 10


class Item(FrozenModel):
    """One thing, where it stands in the door frame, and how large it is."""

    kind: ItemKind
    x_m: float
    y_m: float
    yaw_deg: float
    width_m: float
    depth_m: float
    height_m: float


def item_boxes(item: Item) -> list[Box]:
    """Its boxes in the door frame, all standing on the floor."""
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


def draw_items(
    draws: Draws, count: int, robot_m: tuple[float, float], space: Space, obstacles: list[Box]
) -> tuple[Item, ...]:
    """Up to `count` things that touch neither one another nor the obstacles; about half are between robot and door."""
    items: list[Item] = []
    taken = list(obstacles)
    for _ in range(count * _TRIES_AN_ITEM):
        if len(items) == count:
            break
        item = _draw_item(draws, robot_m, space)
        boxes = item_boxes(item)
        if not collide(boxes, taken, 0.0):
            items.append(item)
            taken += boxes
    return tuple(items)


def _draw_item(draws: Draws, robot_m: tuple[float, float], space: Space) -> Item:
    kind = draws.one_of(dict.fromkeys(_SIZES_M, 1.0))
    if draws.chance(0.5):
        way = draws.between(0.1, 0.9)
        x, y = (
            way * along + draws.between(-aside, aside)
            for along, aside in zip(robot_m, (0.6, 0.3), strict=True)
        )
    else:
        left, right, depth = (
            min(_BAND_M, limit or _BAND_M) for limit in (space.left_m, space.right_m, space.depth_m)
        )
        x, y = draws.between(-right, left), draws.between(0.2, depth)
    width, deep, height = (draws.between(*limits) for limits in _SIZES_M[kind])
    return Item(
        kind=kind,
        x_m=round(x, 4),
        y_m=round(y, 4),
        yaw_deg=draws.between(-180, 180, 2),
        width_m=width,
        depth_m=deep,
        height_m=height,
    )


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
