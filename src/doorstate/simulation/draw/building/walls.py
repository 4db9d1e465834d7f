# SPDX-License-Identifier: Apache-2.0
"""Random fixtures along the walls of a plan: skirting boards, ducts, switches, posters, cupboards, columns."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from doorstate.simulation.draw.building.plan import Plan, turned
from doorstate.simulation.draw.layouts import WallDoor
from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene.box import Material, Pose
from doorstate.simulation.scene.fixture import Fixture, FixtureKind, fixture_boxes
from doorstate.simulation.scene.plan import Footprints, colliding

_Range = tuple[float, float]
_MATERIALS: dict[Material, float] = {"matte": 0.7, "gloss": 0.15, "dark": 0.15}
_LEAST_WAY_M = 0.9  # left beside a fixture on the floor
_CORNER_M = 0.02
_ORIGIN = Pose(0.0, 0.0, 0.0)


class _Sizes(NamedTuple):
    width_m: _Range
    depth_m: _Range
    bottom_m: _Range
    height_m: _Range
    count_per_m: float = 0.0  # of the width; 0 is one


SIZES_M: dict[FixtureKind, _Sizes] = {
    "poster": _Sizes((0.3, 1.0), (0.003, 0.015), (0.8, 1.3), (0.4, 1.0)),
    "board": _Sizes((0.9, 2.4), (0.01, 0.03), (0.7, 1.0), (0.6, 1.3)),
    "picture": _Sizes((0.3, 1.0), (0.015, 0.04), (1.1, 1.5), (0.3, 0.8)),
    "screen": _Sizes((0.5, 1.4), (0.03, 0.10), (1.0, 1.7), (0.35, 0.8)),
    "radiator": _Sizes((0.5, 1.8), (0.08, 0.16), (0.08, 0.15), (0.4, 0.9), 8.0),
    "cupboard": _Sizes((0.4, 2.4), (0.30, 0.62), (0.0, 0.0), (1.2, 2.4), 2.0),
    "shelves": _Sizes((0.5, 1.6), (0.22, 0.45), (0.0, 0.0), (0.8, 2.2), 0.0),
    "counter": _Sizes((1.0, 2.8), (0.45, 0.75), (0.0, 0.0), (0.72, 1.15)),
    "column": _Sizes((0.2, 0.6), (0.08, 0.5), (0.0, 0.0), (0.0, 0.0)),
    "round_column": _Sizes((0.25, 0.5), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)),
    "curtain": _Sizes((0.4, 2.0), (0.06, 0.16), (0.0, 0.1), (1.9, 2.5), 12.0),
    "panels": _Sizes((0.8, 2.2), (0.008, 0.03), (0.0, 0.03), (2.0, 2.3), 1.4),
}
_SHARES: dict[FixtureKind, float] = {
    "poster": 0.22,
    "board": 0.12,
    "picture": 0.12,
    "screen": 0.05,
    "radiator": 0.10,
    "cupboard": 0.12,
    "shelves": 0.08,
    "counter": 0.05,
    "column": 0.07,
    "round_column": 0.02,
    "curtain": 0.02,
    "panels": 0.03,
}
_FULL_HEIGHT: tuple[FixtureKind, ...] = ("column", "round_column")


def draw_wall_fixtures(stream: Stream, plan: Plan, obstacles: Footprints) -> tuple[Fixture, ...]:
    """Draw fixtures along all walls that collide with nothing.

    Args:
        stream: random numbers.
        plan: the room.
        obstacles: boxes to stay clear of.
    """
    has_skirting, skirting = stream.chance(0.55), (stream.uniform(0.05, 0.14), stream.uniform(0.008, 0.02))
    has_duct, duct_z = stream.chance(0.15), stream.choice({0.12: 1, stream.uniform(0.9, 1.1): 1, 2.2: 1})
    has_rail = stream.chance(0.15) and plan.kind in ("corridor", "stairwell")
    crowded = stream.uniform(0.2, 1.0)
    fixtures: list[Fixture] = []
    taken = obstacles
    for wall in range(4):
        new: list[Fixture] = []
        for low, high in plan.free_stretches(wall):
            at = _on_stretch(plan, wall, low, high)
            if high - low < 0.08:
                continue
            if has_skirting:
                new.append(at("skirting", high - low - 2 * _CORNER_M, skirting[1], (0.0, skirting[0])))
            if has_duct and high - low > 0.5:
                new.append(at("duct", high - low - 0.1, 0.05, (duct_z, duct_z + 0.08)))
            has_handrail = has_rail and high - low > 0.8
            if has_handrail:
                new.append(at("handrail", high - low - 0.1, 0.07, (0.0, 0.9)))
            row = _draw_row(stream, plan, wall, (low, high), crowded)
            new += [one for one in row if one.bottom_m > 0.95] if has_handrail else row
        new += [
            switch
            for one in plan.openings(wall)
            if isinstance(one, WallDoor) and stream.chance(0.6)
            for switch in [_draw_switch(stream, plan, one)]
        ]
        kept = clear_of(new, taken)
        fixtures += kept
        deep = [box for fixture in kept if fixture.depth_m > 0.05 for box in fixture_boxes(fixture)]
        taken = taken.joined(Footprints.of(deep))
    return tuple(fixtures)


def draw_fixture(
    stream: Stream, plan: Plan, kind: FixtureKind, wall: int, along_m: float, most_m: float
) -> Fixture | None:
    """Draw a fixture of a kind with its middle at a place on a wall; None if it would be too wide or deep."""
    sizes = SIZES_M[kind]
    width = min(stream.uniform(*sizes.width_m), most_m)
    depth = width if kind == "round_column" else stream.uniform(*sizes.depth_m)
    room = plan.layout.wall_length_m(wall + 1)
    if width < sizes.width_m[0] or (depth > 0.2 and room - depth < _LEAST_WAY_M):
        return None
    bottom = stream.uniform(*sizes.bottom_m)
    top = plan.height_m if kind in _FULL_HEIGHT else bottom + stream.uniform(*sizes.height_m)
    count = max(1, round(width * sizes.count_per_m)) if sizes.count_per_m else 1
    count = stream.integer(3, 6) if kind == "shelves" else count
    material: Material = "gloss" if kind == "screen" else stream.choice(_MATERIALS)
    return _at_wall(
        plan,
        wall,
        along_m,
        kind=kind,
        width_m=round(width, 4),
        depth_m=round(depth, 4),
        bottom_m=bottom,
        top_m=round(min(top, plan.height_m - (0.0 if kind in _FULL_HEIGHT else 0.05)), 4),
        count=count,
        material="dark" if kind == "screen" and stream.chance(0.5) else material,
    )


def _at_wall(plan: Plan, wall: int, along_m: float, **fields: Any) -> Fixture:
    """Return a fixture on a wall, with these fields besides its place."""
    x_m, y_m, yaw_deg = turned(plan.on_wall(wall, along_m), _ORIGIN)
    return Fixture(x_m=x_m, y_m=y_m, yaw_deg=yaw_deg, **fields)


def clear_of(fixtures: list[Fixture], obstacles: Footprints) -> list[Fixture]:
    """Return the fixtures that touch no obstacle."""
    owners, boxes = [], []
    for number, fixture in enumerate(fixtures):
        own = fixture_boxes(fixture)
        owners += [number] * len(own)
        boxes += own
    hit = {owners[number] for number in np.flatnonzero(colliding(boxes, obstacles, 0.001)).tolist()}
    return [fixture for number, fixture in enumerate(fixtures) if number not in hit]


def _draw_row(
    stream: Stream, plan: Plan, wall: int, ends_m: tuple[float, float], crowded: float
) -> list[Fixture]:
    """Draw fixtures one after the other along a stretch of wall."""
    row: list[Fixture] = []
    cursor, high = ends_m[0] + stream.uniform(0.05, 0.8), ends_m[1]
    while high - cursor > 0.3:
        kind = stream.choice(_SHARES)
        width = high - cursor - 0.05
        fixture = None
        if stream.chance(crowded):
            most = min(width, SIZES_M[kind].width_m[1])
            at = cursor + min(most, stream.uniform(*SIZES_M[kind].width_m)) / 2
            fixture = draw_fixture(stream, plan, kind, wall, round(at, 4), 2 * (at - cursor))
        if fixture:
            row.append(fixture)
            cursor += fixture.width_m
        cursor += stream.uniform(0.05, 1.4)
    return row


def _draw_switch(stream: Stream, plan: Plan, door: WallDoor) -> Fixture:
    """Draw a light switch, or the button of a lift, beside a door."""
    side = 1.0 if stream.chance(0.5) else -1.0
    along = door.along_m + side * (door.door.half_width_m + stream.uniform(0.06, 0.3))
    low = stream.uniform(0.85, 1.15)
    return _at_wall(
        plan,
        door.wall,
        along,
        kind="switch",
        width_m=0.08,
        depth_m=stream.uniform(0.008, 0.03),
        bottom_m=low,
        top_m=round(low + stream.choice({0.08: 3, 0.16: 1, 0.3: 1}), 4),
    )


def _on_stretch(plan: Plan, wall: int, low: float, high: float) -> Callable[..., Fixture]:
    """Return a function that places a long fixture in the middle of a stretch of wall."""

    def at(kind: FixtureKind, width: float, depth: float, ends: tuple[float, float]) -> Fixture:
        return _at_wall(
            plan,
            wall,
            (low + high) / 2,
            kind=kind,
            width_m=round(width, 4),
            depth_m=depth,
            bottom_m=ends[0],
            top_m=round(ends[1], 4),
        )

    return at
