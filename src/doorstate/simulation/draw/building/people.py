# SPDX-License-Identifier: Apache-2.0
"""Random people who stand or walk in a room."""

from __future__ import annotations

import math

from doorstate.simulation.draw.building.plan import Plan
from doorstate.simulation.draw.layouts import PlacedCamera
from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene.box import Material
from doorstate.simulation.scene.person import Person, person_boxes
from doorstate.simulation.scene.plan import Footprints, collide

_CHANCE = 0.4
_TRIES = 3
_FROM_CAMERA_M = 0.8
_CLOTHES: dict[Material, float] = {"matte": 0.6, "dark": 0.4}


def draw_people(
    stream: Stream, plan: Plan, camera: PlacedCamera, target_m: tuple[float, float], obstacles: Footprints
) -> tuple[Person, ...]:
    """Draw up to three people; half of them are between the camera and what it looks at."""
    if not stream.chance(_CHANCE):
        return ()
    people: list[Person] = []
    taken = obstacles
    for _ in range(stream.choice({1: 0.6, 2: 0.25, 3: 0.15})):
        for _ in range(_TRIES):
            person = _draw_person(stream, plan, camera, target_m)
            boxes = person_boxes(person)
            near = math.dist((person.x_m, person.y_m), camera.pose[:2]) < _FROM_CAMERA_M
            if near or not plan.contains(person.x_m, person.y_m):
                continue
            if not collide(boxes, taken, 0.0):
                people.append(person)
                taken = taken.joined(Footprints.of(boxes))
                break
    return tuple(people)


def _draw_person(stream: Stream, plan: Plan, camera: PlacedCamera, target_m: tuple[float, float]) -> Person:
    if stream.chance(0.5):
        way = stream.uniform(0.25, 0.95)
        x, y = (
            start + way * (end - start) + stream.uniform(-0.6, 0.6)
            for start, end in zip(camera.pose[:2], target_m, strict=True)
        )
    else:
        x = stream.uniform(0.3, plan.layout.length_m - 0.3)
        y = stream.uniform(0.3, plan.layout.width_m - 0.3)
    return Person(
        x_m=round(x, 4),
        y_m=round(y, 4),
        yaw_deg=stream.uniform(-180, 180, 1),
        height_m=stream.uniform(1.1, 1.4) if stream.chance(0.1) else stream.uniform(1.5, 1.95),
        shoulder_m=stream.uniform(0.32, 0.46),
        stride_m=stream.uniform(0.2, 0.75) if stream.chance(0.5) else 0.0,
        material=stream.choice(_CLOTHES),
    )
