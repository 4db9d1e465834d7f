# SPDX-License-Identifier: Apache-2.0
"""Drum of a revolving door: two curved walls across the wall of the room, open to both sides, under a canopy."""

from __future__ import annotations

import math

from doorstate.simulation.scene.box import Box, place
from doorstate.simulation.scene.door import Door
from doorstate.types import Part

_SEGMENTS = 16  # of a full circle
_WALL_SEGMENTS = 4  # of each wall: a quarter of a circle
_CANOPY_M = 0.20


def drum_boxes(door: Door) -> list[Box]:
    """Return the two curved walls of the drum and its canopy, as flat segments."""
    thickness = door.jamb_thickness_m or door.leaf_thickness_m
    inner, height = door.opening_width_m / 2, door.opening_height_m
    segment = 2 * math.pi / _SEGMENTS
    length = 2 * (inner + thickness) * math.tan(segment / 2)
    wall = Box(Part.FRAME, (inner + thickness / 2, 0.0, height / 2), (thickness, length, height))
    boxes = []
    for side in (0.0, math.pi):
        for number in range(_WALL_SEGMENTS):
            turn = side + (number - (_WALL_SEGMENTS - 1) / 2) * segment
            boxes += place([wall], 0.0, 0.0, turn)
    canopy_m = min(_CANOPY_M, door.wall_height_m - height)
    if canopy_m > 0:
        # The slices of a polygon are in the rectangles between its opposite edges.
        size = (2 * (inner + thickness), length, canopy_m)
        slab = Box(Part.FRAME, (0.0, 0.0, height + canopy_m / 2), size)
        for number in range(_SEGMENTS // 2):
            boxes += place([slab], 0.0, 0.0, (number + 0.5) * segment)
    return place(boxes, 0.0, -door.wall_thickness_m / 2, 0.0)
