# SPDX-License-Identifier: Apache-2.0
"""Random furniture that stands free in a room: tables with their chairs, rows of chairs, plants, bins, cartons."""

from __future__ import annotations

import math
from typing import Literal

from doorstate.simulation.draw.building.plan import Plan
from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene.box import Pose
from doorstate.simulation.scene.clutter import Item, ItemKind, item_boxes
from doorstate.simulation.scene.plan import Footprints, collide

_Group = Literal["desk", "table", "chairs", "plant", "bin", "carton", "cabinet"]
_SHARES: dict[_Group, float] = {
    "desk": 0.2,
    "table": 0.2,
    "chairs": 0.2,
    "plant": 0.12,
    "bin": 0.1,
    "carton": 0.08,
    "cabinet": 0.1,
}
_NARROW_SHARES: dict[_Group, float] = {"bin": 0.25, "plant": 0.25, "chairs": 0.25, "carton": 0.25}
_NARROW_M = 2.2  # rooms below this width have no tables
_TRIES = 3
_OFF_WALL_M = 0.03


def draw_furniture(stream: Stream, plan: Plan, obstacles: Footprints) -> tuple[Item, ...]:
    """Draw groups of furniture that collide neither with one another nor with the obstacles."""
    wide = plan.layout.width_m >= _NARROW_M
    most = {"room": 5, "lobby": 3, "corridor": 2, "junction": 2, "stairwell": 1}[plan.kind]
    taken, items = obstacles, list[Item]()
    for _ in range(stream.integer(0, most)):
        group = stream.choice(_SHARES if wide else _NARROW_SHARES)
        for _ in range(_TRIES):
            new = _draw_group(stream, plan, group)
            boxes = [box for item in new for box in item_boxes(item)]
            inside = all(plan.contains(item.x_m, item.y_m) for item in new)
            if inside and not collide(boxes, taken, 0.0):
                items += new
                taken = taken.joined(Footprints.of(boxes))
                break
    return tuple(items)


def _draw_group(stream: Stream, plan: Plan, group: _Group) -> list[Item]:
    length, width = plan.layout.length_m, plan.layout.width_m
    free = Pose(
        stream.uniform(0.3, length - 0.3),
        stream.uniform(0.3, width - 0.3),
        math.radians(stream.uniform(-180, 180, 1) if stream.chance(0.3) else 90.0 * stream.integer(0, 3)),
    )
    walls = [number for number in range(4) if plan.layout.has_wall[number]]
    wall = stream.choice(dict.fromkeys(walls, 1.0))
    along = stream.uniform(0.3, plan.layout.wall_length_m(wall) - 0.3)
    at_wall = plan.on_wall(wall, along)
    match group:
        case "desk" | "table":
            size = (stream.uniform(0.8, 2.0), stream.uniform(0.6, 0.9), stream.uniform(0.68, 0.78))
            if group == "desk" and stream.chance(0.6):
                table = at_wall.after(Pose(0.0, size[1] / 2 + _OFF_WALL_M, 0.0))
                seats = [1.0]
            else:
                table, seats = free, [1.0, -1.0]
            return [_item("table", table, size), *_draw_seats(stream, table, size, seats)]
        case "chairs":
            size = (stream.uniform(0.42, 0.55), stream.uniform(0.42, 0.55), stream.uniform(0.78, 0.95))
            return [
                _item("chair", at_wall.after(Pose(x, size[1] / 2 + _OFF_WALL_M, math.pi)), size)
                for x in (number * (size[0] + 0.05) for number in range(stream.integer(1, 4)))
            ]
        case "plant":
            side = stream.uniform(0.3, 0.6)
            return [_item("plant", free, (side, side, stream.uniform(0.6, 1.8)))]
        case "bin":
            side = stream.uniform(0.22, 0.4)
            return [
                _item(
                    "bin",
                    at_wall.after(Pose(0.0, side / 2 + 0.02, 0.0)),
                    (side, side, stream.uniform(0.3, 0.9)),
                )
            ]
        case "carton":
            sides = (stream.uniform(0.25, 0.6), stream.uniform(0.25, 0.6), stream.uniform(0.2, 1.2))
            return [_item("carton", free, sides)]
        case _:
            size = (stream.uniform(0.4, 1.0), stream.uniform(0.35, 0.5), stream.uniform(0.6, 1.4))
            return [_item("cabinet", at_wall.after(Pose(0.0, size[1] / 2 + _OFF_WALL_M, 0.0)), size)]


def _draw_seats(
    stream: Stream, table: Pose, size: tuple[float, float, float], sides: list[float]
) -> list[Item]:
    """Draw chairs along the long sides of a table, partly pushed under it."""
    chairs, chair = [], (stream.uniform(0.42, 0.5), stream.uniform(0.42, 0.5), stream.uniform(0.8, 1.0))
    per_side = max(1, int(size[0] / 0.75))
    for side in sides:
        for number in range(per_side):
            if stream.chance(0.75):
                x = ((number + 0.5) / per_side - 0.5) * size[0] + stream.uniform(-0.05, 0.05)
                out = size[1] / 2 + chair[1] / 2 + stream.uniform(0.03, 0.45)
                turn = math.radians(stream.uniform(-25, 25, 1)) + (0.0 if side > 0 else math.pi)
                chairs.append(_item("chair", table.after(Pose(x, side * out, turn)), chair))
    return chairs


def _item(kind: ItemKind, pose: Pose, size: tuple[float, float, float]) -> Item:
    return Item(
        kind=kind,
        x_m=round(pose.x_m, 4),
        y_m=round(pose.y_m, 4),
        yaw_deg=round(math.degrees(math.remainder(pose.yaw_rad, 2 * math.pi)), 2),
        width_m=size[0],
        depth_m=size[1],
        height_m=size[2],
    )
