# SPDX-License-Identifier: Apache-2.0
"""Fixtures: what is fastened to walls or stands against them, and columns."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal, get_args

from pydantic import Field

from doorstate._models import Degrees, FrozenModel, Metres
from doorstate.simulation.scene.box import Box, Material, place
from doorstate.simulation.scene.capsule import capsule
from doorstate.simulation.scene.cupboard import cupboard_boxes
from doorstate.types import Part

FixtureKind = Literal[
    "board",
    "column",
    "counter",
    "cupboard",
    "curtain",
    "duct",
    "handrail",
    "panels",
    "picture",
    "poster",
    "radiator",
    "round_column",
    "screen",
    "shelves",
    "skirting",
    "switch",
]
FIXTURES: tuple[FixtureKind, ...] = get_args(FixtureKind)

_BOARD_M = 0.02  # of shelves, cheeks and tops
_SEAM_M = 0.006
_RIB_M, _BRACKET_M = 0.03, 0.04
_RAIL_M, _POST_EVERY_M = 0.04, 1.2
_OVERHANG_M = 0.03


class Fixture(FrozenModel):
    """A fixture; `x_m` and `y_m` are the middle of its back, and y of its own frame points out of the wall.

    Columns have no back: theirs is the side on y = 0. `count` is the number of fronts, folds, shelves, panels or ribs.
    """

    kind: FixtureKind
    x_m: Metres
    y_m: Metres
    yaw_deg: Degrees
    width_m: Metres
    depth_m: Metres
    bottom_m: Metres = 0.0
    top_m: Metres
    count: int = Field(default=1, ge=1, le=50)
    material: Material = "matte"


def fixture_boxes(fixture: Fixture) -> list[Box]:
    """Return the boxes of a fixture in the door frame."""
    own = _SHAPES.get(fixture.kind, _slab)(fixture)
    return place(own, fixture.x_m, fixture.y_m, math.radians(fixture.yaw_deg))


def _box(
    fixture: Fixture,
    x_m: tuple[float, float],
    y_m: tuple[float, float],
    z_m: tuple[float, float],
    part: Part = Part.OTHER,
) -> Box:
    """Return a box by its ends."""
    ends = (x_m, y_m, z_m)
    center = (sum(x_m) / 2, sum(y_m) / 2, sum(z_m) / 2)
    size = tuple(high - low for low, high in ends)
    return Box(part, center, (size[0], size[1], size[2]), material=fixture.material)


def _slab(fixture: Fixture, part: Part = Part.OTHER) -> list[Box]:
    half = fixture.width_m / 2
    return [_box(fixture, (-half, half), (0.0, fixture.depth_m), (fixture.bottom_m, fixture.top_m), part)]


def _structure(fixture: Fixture) -> list[Box]:
    return _slab(fixture, Part.WALL)


def _round_column(fixture: Fixture) -> list[Box]:
    radius = fixture.width_m / 2
    # The half-spheres lie below the floor and above the ceiling.
    column = capsule(Part.WALL, 0.0, radius, (-radius, fixture.top_m + radius), radius, fixture.material)
    return [column]


def _cupboard(fixture: Fixture) -> list[Box]:
    return cupboard_boxes(fixture.width_m, fixture.depth_m, fixture.top_m, fixture.count, fixture.material)


def _shelves(fixture: Fixture) -> list[Box]:
    """Return two cheeks, a thin back, and `count` shelves besides the bottom."""
    half, depth, low, top = fixture.width_m / 2, fixture.depth_m, fixture.bottom_m, fixture.top_m
    inner = half - _BOARD_M
    cheeks = [
        _box(
            fixture,
            (side * half - _BOARD_M / 2 * (1 + side), side * half + _BOARD_M / 2 * (1 - side)),
            (0.0, depth),
            (low, top),
        )
        for side in (-1, 1)
    ]
    back = _box(fixture, (-inner, inner), (0.0, 0.005), (low, top))
    step = (top - low - _BOARD_M) / fixture.count
    heights = [low + number * step for number in range(fixture.count + 1)]
    return [
        *cheeks,
        back,
        *(_box(fixture, (-inner, inner), (0.005, depth), (z, z + _BOARD_M)) for z in heights),
    ]


def _curtain(fixture: Fixture) -> list[Box]:
    """Return folds that lie alternately before and behind one another."""
    fold, half = fixture.width_m / fixture.count, fixture.depth_m / 2
    return [
        _box(
            fixture,
            (number * fold - fixture.width_m / 2, (number + 1) * fold - fixture.width_m / 2),
            ((number % 2) * half, (number % 2 + 1) * half),
            (fixture.bottom_m, fixture.top_m),
        )
        for number in range(fixture.count)
    ]


def _radiator(fixture: Fixture) -> list[Box]:
    """Return a plate before the wall with vertical ribs."""
    half, depth, heights = fixture.width_m / 2, fixture.depth_m, (fixture.bottom_m, fixture.top_m)
    front = depth - _RIB_M
    plate = _box(fixture, (-half, half), (_BRACKET_M, front), heights)
    step = fixture.width_m / fixture.count
    ribs = [
        _box(fixture, (at, at + step / 2), (front, depth), heights)
        for at in (number * step + step / 4 - half for number in range(fixture.count))
    ]
    return [plate, *ribs]


def _panels(fixture: Fixture) -> list[Box]:
    """Return panels side by side with seams between them."""
    step = fixture.width_m / fixture.count
    return [
        _box(
            fixture,
            (at + _SEAM_M / 2, at + step - _SEAM_M / 2),
            (0.0, fixture.depth_m),
            (fixture.bottom_m, fixture.top_m),
        )
        for at in (number * step - fixture.width_m / 2 for number in range(fixture.count))
    ]


def _counter(fixture: Fixture) -> list[Box]:
    """Return a body below a top that overhangs it."""
    half, depth, top = fixture.width_m / 2, fixture.depth_m, fixture.top_m
    body = _box(
        fixture, (-half + _OVERHANG_M, half - _OVERHANG_M), (0.0, depth - _OVERHANG_M), (0.0, top - 0.04)
    )
    return [body, _box(fixture, (-half, half), (0.0, depth), (top - 0.04, top))]


def _handrail(fixture: Fixture) -> list[Box]:
    """Return a rail along a wall on brackets."""
    half, depth, top = fixture.width_m / 2, fixture.depth_m, fixture.top_m
    rail = _box(fixture, (-half, half), (depth - _RAIL_M, depth), (top - _RAIL_M, top))
    posts = max(2, math.ceil(fixture.width_m / _POST_EVERY_M))
    step = fixture.width_m / posts
    brackets = [
        _box(fixture, (at - 0.01, at + 0.01), (0.0, depth - _RAIL_M), (top - _RAIL_M, top - _RAIL_M / 2))
        for at in ((number + 0.5) * step - half for number in range(posts))
    ]
    return [rail, *brackets]


_SHAPES: dict[FixtureKind, Callable[[Fixture], list[Box]]] = {
    "column": _structure,
    "counter": _counter,
    "cupboard": _cupboard,
    "curtain": _curtain,
    "handrail": _handrail,
    "panels": _panels,
    "radiator": _radiator,
    "round_column": _round_column,
    "shelves": _shelves,
}
"""Shapes of kinds that are more than one box of part `other`."""
