# SPDX-License-Identifier: Apache-2.0
"""Oracle of the renderer: one ray, one box, one axis at a time, in plain Python."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from doorstate.io.camera import Intrinsics
from doorstate.simulation.camera import CameraPose
from doorstate.simulation.scene import Box
from doorstate.types import Part

Vector = tuple[float, float, float]


def turn_z(vector: Vector, angle_rad: float) -> Vector:
    x, y, z = vector
    return (
        x * math.cos(angle_rad) - y * math.sin(angle_rad),
        x * math.sin(angle_rad) + y * math.cos(angle_rad),
        z,
    )


def pixel_ray(row: int, column: int, pose: CameraPose, camera: Intrinsics) -> Vector:
    """Return the ray's direction in the door frame, scaled to unit z-depth."""
    left, up = (camera.cx - column) / camera.fx, (camera.cy - row) / camera.fy
    # Roll turns about x: a camera turned clockwise sees at its left what is above.
    cos, sin = math.cos(pose.roll_rad), math.sin(pose.roll_rad)
    left, up = left * cos - up * sin, left * sin + up * cos
    cos, sin = math.cos(pose.pitch_rad), math.sin(pose.pitch_rad)
    # Pitch turns about y, and a positive one looks down.
    return turn_z((cos + up * sin, left, up * cos - sin), pose.yaw_rad)


def box_depth(box: Box, origin: Vector, ray: Vector) -> float:
    """Return the z-depth at which the ray enters the box, infinite if it misses."""
    offset = turn_z(tuple(a - b for a, b in zip(origin, box.center_m, strict=True)), -box.yaw_rad)
    direction = turn_z(ray, -box.yaw_rad)
    enter, leave = 0.0, math.inf
    for axis in range(3):
        half = box.size_m[axis] / 2
        if direction[axis] == 0:
            if abs(offset[axis]) > half:
                return math.inf
            continue
        crossings = sorted((side * half - offset[axis]) / direction[axis] for side in (-1, 1))
        enter, leave = max(enter, crossings[0]), min(leave, crossings[1])
    return enter if enter <= leave else math.inf


def cast(boxes: Sequence[Box], pose: CameraPose, camera: Intrinsics) -> tuple[np.ndarray, np.ndarray]:
    """Return depth and part of every pixel."""
    depth = np.full((camera.height, camera.width), np.inf)
    part = np.full(depth.shape, int(Part.NONE))
    for row in range(camera.height):
        for column in range(camera.width):
            ray = pixel_ray(row, column, pose, camera)
            for box in boxes:
                hit = box_depth(box, pose[:3], ray)
                if hit < depth[row, column]:
                    depth[row, column], part[row, column] = hit, box.part
    return depth, part
