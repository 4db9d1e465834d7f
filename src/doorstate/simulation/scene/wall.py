# SPDX-License-Identifier: Apache-2.0
"""Straight walls with gaps for doors and other openings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from doorstate.simulation.scene.box import Box
from doorstate.simulation.scene.door import Door
from doorstate.types import Part


class Gap(NamedTuple):
    """A gap in a wall."""

    x_m: float  # of its middle
    half_width_m: float
    top_m: float
    bottom_m: float = 0.0


def door_gap(door: Door, x_m: float = 0.0) -> Gap:
    """Return the gap that a door with its jambs fills."""
    jamb = door.jamb_thickness_m
    return Gap(x_m, door.opening_width_m / 2 + jamb, door.opening_height_m + jamb)


def wall_boxes(
    ends_m: tuple[float, float], thickness_m: float, height_m: float, gaps: Sequence[Gap]
) -> list[Box]:
    """Return a wall along x whose face is y = 0: the stretches beside its gaps from +x to -x, lintels, sills."""
    y = -thickness_m / 2
    boxes = []
    ordered = sorted(gaps, key=lambda gap: -gap.x_m)
    highs = [ends_m[1], *(gap.x_m - gap.half_width_m for gap in ordered)]
    lows = [*(gap.x_m + gap.half_width_m for gap in ordered), ends_m[0]]
    for low, high in zip(lows, highs, strict=True):
        if high > low:
            length = high - low
            # From the end nearer to the middle: published scenes depend on the last bit.
            x = high - length / 2 if high <= 0 else low + length / 2
            boxes.append(Box(Part.WALL, (x, y, height_m / 2), (length, thickness_m, height_m)))
    for gap in ordered:
        if height_m > gap.top_m:
            size = (2 * gap.half_width_m, thickness_m, height_m - gap.top_m)
            boxes.append(Box(Part.WALL, (gap.x_m, y, (gap.top_m + height_m) / 2), size))
    for gap in ordered:
        if gap.bottom_m > 0:
            size = (2 * gap.half_width_m, thickness_m, gap.bottom_m)
            boxes.append(Box(Part.WALL, (gap.x_m, y, gap.bottom_m / 2), size))
    return boxes
