# SPDX-License-Identifier: Apache-2.0
"""Cupboards: a carcass on a plinth with closed fronts, each with a knob."""

from __future__ import annotations

from doorstate.simulation.scene.box import Box, Material
from doorstate.types import Part

_FRONT_M, _GAP_M, _PLINTH_M, _KNOB_M = 0.018, 0.003, 0.08, 0.025


def cupboard_boxes(
    width_m: float, depth_m: float, top_m: float, fronts: int, material: Material = "matte"
) -> list[Box]:
    """Return a cupboard on the floor with its back on y = 0; a knob sits towards the middle of the whole width."""
    width, depth, top = width_m, depth_m, top_m
    body = depth - _FRONT_M
    middle = (_PLINTH_M + top) / 2
    boxes = [
        Box(Part.OTHER, (0.0, (body - 0.05) / 2, _PLINTH_M / 2), (width - 0.02, body - 0.05, _PLINTH_M)),
        Box(Part.OTHER, (0.0, body / 2, middle), (width, body, top - _PLINTH_M), material=material),
    ]
    front = width / fronts
    for number in range(fronts):
        x = (number + 0.5) * front - width / 2
        size = (front - _GAP_M, _FRONT_M, top - _PLINTH_M - _GAP_M)
        boxes.append(Box(Part.OTHER, (x, body + _FRONT_M / 2, middle), size, material=material))
        towards_middle = -1.0 if x > 0 else 1.0
        knob_x = x + towards_middle * (front / 2 - 0.05)
        boxes.append(Box(Part.OTHER, (knob_x, depth + _KNOB_M / 2, 1.0), (_KNOB_M, _KNOB_M, _KNOB_M)))
    return boxes
