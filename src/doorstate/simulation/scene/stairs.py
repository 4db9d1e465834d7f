# SPDX-License-Identifier: Apache-2.0
"""Straight flights of stairs that lead up or down."""

from __future__ import annotations

import math

from pydantic import Field

from doorstate._models import Degrees, FrozenModel, Metres
from doorstate.simulation.scene.box import Box, place
from doorstate.simulation.scene.room import FLOOR_M
from doorstate.types import Part

_BALUSTER_M, _RAIL_M, _RAIL_HEIGHT_M = 0.02, 0.05, 0.9
_SHAFT_M = 0.1


class Stairs(FrozenModel):
    """A flight; `x_m` and `y_m` are the middle of its first edge, and y of its own frame leads along it.

    It ends in a landing of `landing_m`. A negative rise leads down, through a hole in the floor.
    """

    x_m: Metres
    y_m: Metres
    yaw_deg: Degrees
    width_m: Metres
    going_m: Metres
    rise_m: Metres
    steps: int = Field(ge=1, le=40)
    landing_m: Metres = 0.0
    rails: tuple[bool, bool] = (
        False,
        False,
    )  # a balustrade on the left and on the right, looking along the flight

    @property
    def length_m(self) -> float:
        """Length in plan with the landing."""
        return self.steps * self.going_m + self.landing_m

    def outline(self) -> Box:
        """Return the floor that the flight needs, as a flat box in the door frame."""
        box = Box(Part.FLOOR, (0.0, self.length_m / 2, 0.0), (self.width_m, self.length_m, 0.2))
        return place([box], self.x_m, self.y_m, math.radians(self.yaw_deg))[0]


def stairs_boxes(stairs: Stairs) -> list[Box]:
    """Return steps, landing, balustrades and, below the floor, the walls of the shaft in the door frame."""
    boxes = []
    deepest = min(0.0, stairs.rise_m * (stairs.steps + 1))
    for number in range(1, stairs.steps + 1):
        last = stairs.landing_m if number == stairs.steps else 0.0
        start, top = (number - 1) * stairs.going_m, number * stairs.rise_m
        boxes.append(_step(stairs, start, stairs.going_m + last, deepest, top))
        for side, has_rail in zip((-1, 1), stairs.rails, strict=True):
            if has_rail:
                beside = _RAIL_M if deepest else -_RAIL_M  # of a hole, or on the steps
                boxes += _balusters(stairs, side * (stairs.width_m / 2 + beside), start, top)
    if deepest:
        boxes += _shaft(stairs, -deepest)
    return place(boxes, stairs.x_m, stairs.y_m, math.radians(stairs.yaw_deg))


def _shaft(stairs: Stairs, depth_m: float) -> list[Box]:
    """Return the walls around a flight that leads down, below the floor: on both sides and at its end."""
    z, height = -(FLOOR_M + depth_m) / 2, depth_m - FLOOR_M
    boxes = [
        Box(
            Part.WALL,
            (side * (stairs.width_m + _SHAFT_M) / 2, stairs.length_m / 2, z),
            (_SHAFT_M, stairs.length_m, height),
        )
        for side in (-1, 1)
    ]
    end = (0.0, stairs.length_m + _SHAFT_M / 2, z)
    return [*boxes, Box(Part.WALL, end, (stairs.width_m, _SHAFT_M, height))]


def _step(stairs: Stairs, start_m: float, length_m: float, bottom_m: float, top_m: float) -> Box:
    center = (0.0, start_m + length_m / 2, (bottom_m + top_m) / 2)
    return Box(Part.OTHER, center, (stairs.width_m, length_m, top_m - bottom_m))


def _balusters(stairs: Stairs, x_m: float, start_m: float, top_m: float) -> list[Box]:
    """Return a post and a piece of rail: boxes are upright, so the rail is stepped; beside a hole it is level."""
    y, foot, thickness = start_m + stairs.going_m / 2, max(top_m, 0.0), max(stairs.rise_m, _RAIL_M)
    rail_z = foot + _RAIL_HEIGHT_M
    post = Box(Part.OTHER, (x_m, y, (foot + rail_z) / 2), (_BALUSTER_M, _BALUSTER_M, _RAIL_HEIGHT_M))
    rail = Box(Part.OTHER, (x_m, y, rail_z + thickness / 2), (_RAIL_M, stairs.going_m, thickness))
    return [post, rail]
