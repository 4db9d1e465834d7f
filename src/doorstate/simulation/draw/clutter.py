# SPDX-License-Identifier: Apache-2.0
"""Random clutter that collides with nothing."""

from __future__ import annotations

from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene.box import Box
from doorstate.simulation.scene.clutter import Item, ItemKind, item_boxes
from doorstate.simulation.scene.plan import collide
from doorstate.simulation.scene.room import Space

_BAND_M = 3.0  # beside the door and before it
_Range = tuple[float, float]
_SIZES_M: dict[ItemKind, tuple[_Range, _Range, _Range]] = {  # ranges of width, depth and height
    "chair": ((0.40, 0.50), (0.40, 0.50), (0.80, 1.00)),
    "table": ((0.80, 1.40), (0.60, 0.80), (0.70, 0.76)),
    "cabinet": ((0.40, 1.00), (0.35, 0.50), (0.70, 1.90)),
    "bin": ((0.25, 0.40), (0.25, 0.40), (0.30, 0.70)),
    "plant": ((0.30, 0.60), (0.30, 0.60), (0.60, 1.60)),
    "person": ((0.40, 0.50), (0.25, 0.35), (1.55, 1.90)),
    "carton": ((0.30, 0.60), (0.30, 0.60), (0.30, 0.90)),
}
_TRIES_PER_ITEM = 10


def draw_items(
    stream: Stream, count: int, robot_m: tuple[float, float], space: Space, obstacles: list[Box]
) -> tuple[Item, ...]:
    """Draw up to `count` items that touch neither one another nor the obstacles.

    About half of them stand between the robot and the door.

    Args:
        stream: random numbers.
        count: most items; fewer if there is no room for them.
        robot_m: x and y of the robot in the door frame.
        space: on the robot's side of the wall.
        obstacles: boxes to stay clear of.
    """
    items: list[Item] = []
    taken = list(obstacles)
    for _ in range(count * _TRIES_PER_ITEM):
        if len(items) == count:
            break
        item = _draw_item(stream, robot_m, space)
        boxes = item_boxes(item)
        if not collide(boxes, taken, 0.0):
            items.append(item)
            taken += boxes
    return tuple(items)


def _draw_item(stream: Stream, robot_m: tuple[float, float], space: Space) -> Item:
    kind = stream.choice(dict.fromkeys(_SIZES_M, 1.0))
    if stream.chance(0.5):
        way = stream.uniform(0.1, 0.9)
        x, y = (
            way * along + stream.uniform(-aside, aside)
            for along, aside in zip(robot_m, (0.6, 0.3), strict=True)
        )
    else:
        left, right, depth = (
            min(_BAND_M, limit or _BAND_M) for limit in (space.left_m, space.right_m, space.depth_m)
        )
        x, y = stream.uniform(-right, left), stream.uniform(0.2, depth)
    width, deep, height = (stream.uniform(*limits) for limits in _SIZES_M[kind])
    return Item(
        kind=kind,
        x_m=round(x, 4),
        y_m=round(y, 4),
        yaw_deg=stream.uniform(-180, 180, 2),
        width_m=width,
        depth_m=deep,
        height_m=height,
    )
