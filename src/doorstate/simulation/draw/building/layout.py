# SPDX-License-Identifier: Apache-2.0
"""Random plans: corridors, rooms, junctions of corridors, lobbies of lifts, and stairwells."""

from __future__ import annotations

from typing import NamedTuple

from doorstate.simulation.draw.building.apertures import draw_passage, draw_windows
from doorstate.simulation.draw.building.doors import (
    draw_building_door,
    draw_door_like,
    draw_lift_door,
)
from doorstate.simulation.draw.building.plan import Plan, WallAperture
from doorstate.simulation.draw.building.stairs import draw_stairs
from doorstate.simulation.draw.doors import WALL_HEIGHT_M
from doorstate.simulation.draw.layouts import Layout, WallDoor
from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene.box import Box
from doorstate.simulation.scene.door import Door
from doorstate.simulation.scene.plan import collide
from doorstate.simulation.scene.room import Space
from doorstate.simulation.scene.scene import LayoutKind
from doorstate.types import Part

LAYOUTS: dict[LayoutKind, float] = {
    "corridor": 0.34,
    "room": 0.26,
    "junction": 0.16,
    "lobby": 0.12,
    "stairwell": 0.12,
}
INNER_WALL_M, _OUTER_WALL_M = (0.08, 0.25), (0.24, 0.45)
_STAIRWELL_HEIGHT_M = (4.6, 5.6)
_PLACE_TRIES = 12
_LANDING_M = 1.1


class _Size(NamedTuple):
    length_m: tuple[float, float]
    width_m: tuple[float, float]


_SIZES: dict[LayoutKind, _Size] = {
    "corridor": _Size((5.0, 12.0), (1.2, 3.0)),
    "room": _Size((3.0, 8.0), (2.8, 6.5)),
    "junction": _Size((5.0, 11.0), (1.4, 3.0)),
    "lobby": _Size((3.6, 7.0), (2.0, 4.5)),
    "stairwell": _Size((3.6, 6.5), (2.5, 3.8)),
}


def draw_plan(stream: Stream, kind: LayoutKind, has_doors: bool, style: Door | None = None) -> Plan:
    """Draw a room with doors and apertures; far spaces of doors are drawn by `draw_spaces_behind`.

    Args:
        stream: random numbers.
        kind: kind of room.
        has_doors: draw doors.
        style: all doors but those of lifts are like this one, and the inner walls like its wall; drawn if not given.
    """
    length, width = (stream.uniform(*ends) for ends in _SIZES[kind])
    thicknesses = (
        stream.uniform(*INNER_WALL_M),
        stream.uniform(*INNER_WALL_M),
        stream.uniform(*INNER_WALL_M),
        stream.uniform(*INNER_WALL_M),
    )
    ends = (
        (True, True) if kind in ("room", "lobby", "stairwell") else (stream.chance(0.75), stream.chance(0.6))
    )
    layout = Layout(length, width, (True, ends[0], True, ends[1]))
    height = stream.uniform(*(_STAIRWELL_HEIGHT_M if kind == "stairwell" else WALL_HEIGHT_M))
    if style is not None:
        thicknesses, height = (style.wall_thickness_m,) * 4, style.wall_height_m
    plan = Plan(kind, layout, thicknesses, height)
    if kind in ("room", "corridor", "lobby") and stream.chance(0.5):
        plan = _with_windows(stream, plan)
    if kind == "junction":
        plan = _with_passage(stream, plan, stream.choice({0: 0.4, 1: 0.2, 2: 0.4}), full_height=True)
        if stream.chance(0.25):
            plan = _with_passage(stream, plan, stream.choice({0: 0.5, 2: 0.5}), full_height=True)
    elif stream.chance(0.12):
        plan = _with_passage(stream, plan, stream.integer(0, 3), full_height=False)
    if kind == "stairwell":
        plan = draw_stairs(stream, plan)
    return _with_doors(stream, plan, style) if has_doors else plan


def _with_windows(stream: Stream, plan: Plan) -> Plan:
    """Return the plan with windows in one wall, which is then an outer wall."""
    wall = 1 if plan.kind == "corridor" else stream.integer(0, 3)
    thicknesses = list(plan.thicknesses_m)
    thicknesses[wall] = stream.uniform(*_OUTER_WALL_M)
    plan = plan._replace(thicknesses_m=(thicknesses[0], thicknesses[1], thicknesses[2], thicknesses[3]))
    if not plan.layout.has_wall[wall]:
        return plan
    return plan._replace(apertures=(*plan.apertures, *draw_windows(stream, plan, wall)))


def _with_passage(stream: Stream, plan: Plan, wall: int, full_height: bool) -> Plan:
    if not plan.layout.has_wall[wall] or any(one.wall == wall for one in plan.apertures):
        return plan
    passage = draw_passage(stream, plan, wall, full_height)
    return plan._replace(apertures=(*plan.apertures, passage)) if passage else plan


def _with_doors(stream: Stream, plan: Plan, style: Door | None) -> Plan:
    """Return the plan with doors in walls that fit the kind of room."""
    match plan.kind:
        case "corridor" | "junction":
            count = stream.choice({2: 0.3, 3: 0.4, 4: 0.3})
            walls = [2 * stream.integer(0, 1) for _ in range(count)]
            if stream.chance(0.5):
                walls.append(1)
        case "room":
            walls = [stream.integer(0, 3) for _ in range(stream.choice({2: 0.5, 3: 0.3, 4: 0.2}))]
        case "lobby":
            plan = _with_lifts(stream, plan)
            walls = [stream.integer(1, 3) for _ in range(stream.integer(1, 2))]
        case _:
            walls = [stream.choice({0: 0.5, 1: 0.25, 3: 0.25}) for _ in range(stream.integer(1, 3))]
    for wall in walls:
        plan = _with_door(stream, plan, wall, style)
    return plan


def _with_door(stream: Stream, plan: Plan, wall: int, style: Door | None) -> Plan:
    """Return the plan with one more door in a wall, if there is a place for it."""
    if not plan.layout.has_wall[wall] or any(
        one.wall == wall and one.aperture.kind == "window" for one in plan.apertures
    ):
        return plan
    if style is None:
        door = draw_building_door(stream, (plan.thicknesses_m[wall], plan.height_m))
    else:
        door = draw_door_like(stream, style)
    stairs = [flight.outline() for flight in plan.stairs]
    for _ in range(_PLACE_TRIES):
        candidate = WallDoor(wall, stream.uniform(0.0, plan.layout.wall_length_m(wall)), door)
        if plan.fits(candidate) and not collide([_landing(plan, candidate)], stairs):
            return plan.with_door(candidate)
    return plan


def _landing(plan: Plan, door: WallDoor) -> Box:
    """Return the floor before a door, which stairs keep clear of."""
    width = 2 * door.door.half_width_m
    floor = Box(Part.FLOOR, (0.0, _LANDING_M / 2, 0.0), (width, _LANDING_M, 0.2))
    return plan.on_wall(door.wall, door.along_m).place([floor])[0]


def _with_lifts(stream: Stream, plan: Plan) -> Plan:
    """Return the plan with one to three equal lifts side by side in the first wall."""
    thicknesses = (stream.uniform(0.20, 0.35), *plan.thicknesses_m[1:])
    plan = plan._replace(thicknesses_m=(thicknesses[0], thicknesses[1], thicknesses[2], thicknesses[3]))
    if any(one.wall == 0 for one in plan.apertures):
        return plan
    door = draw_lift_door(stream, (plan.thicknesses_m[0], plan.height_m))
    half, depth = stream.uniform(0.55, 1.0), stream.uniform(1.2, 2.2)
    cabin = Space(left_m=half, right_m=half, depth_m=depth)
    count, pitch = (
        stream.integer(1, 3),
        max(2 * half, 2 * door.opening_width_m, 2 * door.half_width_m + 0.35) + stream.uniform(0.15, 0.6),
    )
    first = stream.uniform(1.0, 1.7) + door.opening_width_m / 2
    for number in range(count):
        lift = WallDoor(0, round(first + number * pitch, 4), door, cabin)
        if plan.fits(lift):
            plan = plan.with_door(lift)
    return plan


def draw_spaces_behind(stream: Stream, plan: Plan) -> Plan:
    """Draw the space behind each door that has none yet: a room, open space, or outdoors.

    Rooms end between their own door and the next opening of the wall, and at the wall's ends.
    """
    doors = []
    for door in plan.layout.doors:
        far = door.far if door.far != Space() else _draw_space(stream, plan, door)
        doors.append(door._replace(far=far))
    return plan._replace(layout=plan.layout._replace(doors=tuple(doors)))


def _draw_space(stream: Stream, plan: Plan, door: WallDoor) -> Space:
    low, high = interval(plan, door)
    kind = stream.choice({"room": 0.72, "corridor": 0.15, "outdoors": 0.13})
    if kind == "outdoors":
        return Space(is_outdoors=True)
    reach = (0.0, 3.5) if kind == "room" else (3.0, 6.0)
    right, left = (
        max(door.door.half_width_m, min(door.half_m + stream.uniform(*reach), distance))
        for distance in (door.along_m - low, high - door.along_m)
    )
    depth = stream.uniform(*((1.2, 2.4) if kind == "corridor" else (1.5, 6.0)))
    return Space(left_m=round(left, 4), right_m=round(right, 4), depth_m=round(depth, 4))


def interval(plan: Plan, opening: WallDoor | WallAperture) -> tuple[float, float]:
    """Return the ends of the stretch of wall behind which the space of an opening may lie."""
    low, high = 0.0, plan.layout.wall_length_m(opening.wall)
    for other in plan.openings(opening.wall):
        middle = _middle_between(opening, other)
        if other.along_m < opening.along_m:
            low = max(low, middle + 0.05)
        elif other.along_m > opening.along_m:
            high = min(high, middle - 0.05)
    return low, high


def _middle_between(opening: WallDoor | WallAperture, other: WallDoor | WallAperture) -> float:
    """Return where two spaces meet: halfway, or at the end of a passage's or cabin's own space."""
    space = other.far if isinstance(other, WallDoor) else other.aperture.beyond
    side = 1.0 if other.along_m < opening.along_m else -1.0
    reach = space.left_m if side > 0 else space.right_m
    if reach:
        return other.along_m + side * (reach + 0.1)
    return (opening.along_m + other.along_m) / 2
