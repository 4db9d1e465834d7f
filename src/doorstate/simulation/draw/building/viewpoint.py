# SPDX-License-Identifier: Apache-2.0
"""Random cameras of robots, wheelchairs and people in a building."""

from __future__ import annotations

import math

from doorstate.simulation.draw.building.plan import Plan
from doorstate.simulation.draw.layouts import PlacedCamera
from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene.box import Box, Pose
from doorstate.types import Part

DISTANCE_M = (0.6, 6.0)
HEIGHT_M, PITCH_DEG, ROLL_DEG = (0.25, 1.8), (-20.0, 35.0), (-5.0, 5.0)
_OFF_WALL_M, _FAR_M = 0.3, 1.5
_BODY_M = 0.4  # of a slim robot, or of a person with a camera in their hands
_MOST_BESIDE_NORMAL_DEG = 87.0
_OFFSET_DEG, _WIDE_OFFSET_DEG = 18.0, 38.0  # of the target from the middle; the wider ones cut doors off
_TRIES, _TRIES_PER_DISTANCE = 40, 10  # so that far places of narrow rooms are found too


def draw_camera(stream: Stream, plan: Plan, target: Pose) -> PlacedCamera | None:
    """Draw a camera in the room that looks towards a place on its walls; None if the room leaves no space.

    Args:
        stream: random numbers.
        plan: the room.
        target: frame of a door or of another place on a wall.
    """
    height = stream.uniform(*HEIGHT_M)
    pitch = stream.uniform(-8, 12) if stream.chance(0.5) else stream.uniform(*PITCH_DEG)
    roll = stream.uniform(-1.5, 1.5) if stream.chance(0.5) else stream.uniform(*ROLL_DEG)
    length, width = plan.layout.length_m, plan.layout.width_m
    for number in range(_TRIES):
        if number % _TRIES_PER_DISTANCE == 0:
            distance = stream.uniform(DISTANCE_M[0] if stream.chance(0.3) else _FAR_M, DISTANCE_M[1])
        beside = math.radians(stream.uniform(-_MOST_BESIDE_NORMAL_DEG, _MOST_BESIDE_NORMAL_DEG))
        spot = target.after(Pose(distance * math.sin(beside), distance * math.cos(beside), 0.0))
        x, y = round(spot.x_m, 4), round(spot.y_m, 4)
        if _OFF_WALL_M <= x <= length - _OFF_WALL_M and _OFF_WALL_M <= y <= width - _OFF_WALL_M:
            bearing = math.atan2(target.y_m - y, target.x_m - x)
            offset = _OFFSET_DEG if stream.chance(0.5) else _WIDE_OFFSET_DEG
            heading = bearing + math.radians(stream.uniform(-offset, offset))
            if plan.kind in ("corridor", "junction") and stream.chance(0.4):
                # Robots drive along corridors.
                along = 0.0 if math.cos(bearing) > 0 else math.pi
                heading = along + math.radians(stream.uniform(-15, 15))
            return PlacedCamera(Pose(x, y, heading), height, pitch, roll)
    return None


def body_box(camera: PlacedCamera) -> Box:
    """Return what carries the camera, up to a little above it."""
    top = camera.height_m + 0.15
    x, y, yaw = camera.pose
    return Box(Part.OTHER, (x, y, top / 2), (_BODY_M, _BODY_M, top), yaw)
