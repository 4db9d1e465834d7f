# SPDX-License-Identifier: Apache-2.0
"""People built of upright capsules: trunk, head, arms and legs."""

from __future__ import annotations

import math

from doorstate._models import Degrees, FrozenModel, Metres
from doorstate.simulation.scene.box import Box, Material, place
from doorstate.simulation.scene.capsule import capsule
from doorstate.types import Part

# Shares of the height, after the segment lengths of Drillis & Contini (1966): hip joint, shoulder, chin, wrist.
_HIP, _SHOULDER, _CHIN, _WRIST = 0.53, 0.83, 0.87, 0.47
_HEAD, _LEG, _ARM = 0.055, 0.045, 0.03  # radii


class Person(FrozenModel):
    """A person who stands or walks; y of the own frame is where they look. `stride_m` is between the two feet."""

    x_m: Metres
    y_m: Metres
    yaw_deg: Degrees
    height_m: Metres
    shoulder_m: Metres  # width of the trunk
    stride_m: Metres = 0.0
    material: Material = "matte"  # of the clothes


def person_boxes(person: Person) -> list[Box]:
    """Return the capsules of a person in the door frame."""
    tall, half, material = person.height_m, person.shoulder_m / 2, person.material
    leg, arm, head, trunk = _LEG * tall, _ARM * tall, _HEAD * tall, 0.62 * half
    boxes: list[Box] = []
    for side in (-1, 1):
        # Two capsules make the trunk wider than deep.
        x, swing = side * (half - trunk), side * person.stride_m / 2
        boxes += [
            capsule(Part.OTHER, x, 0.0, (_HIP * tall - trunk / 2, _SHOULDER * tall), trunk, material),
            capsule(Part.OTHER, side * 1.25 * leg, swing, (0.0, _HIP * tall + leg), leg, material),
            capsule(
                Part.OTHER,
                side * (half + 0.5 * arm),
                -swing / 2,
                (_WRIST * tall - arm, _SHOULDER * tall - arm),
                arm,
                material,
            ),
        ]
    boxes.append(capsule(Part.OTHER, 0.0, 0.0, (_CHIN * tall - head / 2, tall), head))
    return place(boxes, person.x_m, person.y_m, math.radians(person.yaw_deg))
