# SPDX-License-Identifier: Apache-2.0
"""Clouds of rooms made of boxes, as a depth camera at a known height and tilt measures them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from doorstate.io.depth import depth_to_points
from doorstate.simulation.camera import CameraPose, DepthCamera
from doorstate.simulation.render import render
from doorstate.simulation.scene.box import Box
from doorstate.types import Part, Points

FLOOR = Box(Part.FLOOR, (0.0, 0.0, -0.05), (20.0, 20.0, 0.1))
CEILING = Box(Part.CEILING, (0.0, 0.0, 2.65), (20.0, 20.0, 0.1))
CAMERA = DepthCamera(width=160, height=120, hfov_deg=60.0, min_depth_m=0.1, max_depth_m=8.0)


def wall(distance_m: float, bearing_deg: float = 0.0) -> Box:
    """Return a wall across this bearing from the camera, at this distance."""
    bearing = math.radians(bearing_deg)
    reach_m = distance_m + 0.05
    center = reach_m * math.cos(bearing), reach_m * math.sin(bearing), 1.3
    return Box(Part.WALL, center, (0.1, 20.0, 2.6), bearing)


def table(distance_m: float, height_m: float = 0.72) -> Box:
    """Return a table top of 1.6 x 0.8 m without legs."""
    return Box(Part.OTHER, (distance_m, 0.0, height_m - 0.02), (0.8, 1.6, 0.04))


def measure(
    boxes: Sequence[Box],
    *,
    height_m: float = 1.0,
    pitch_deg: float = 0.0,
    roll_deg: float = 0.0,
    camera: DepthCamera = CAMERA,
) -> Points:
    """Return the cloud (H, W, 3) of a camera that looks along x, in its own frame: x forward, y left, z up."""
    pose = CameraPose.from_degrees((0.0, 0.0, height_m), 0.0, pitch_deg, roll_deg)
    depth_m = render(boxes, pose, camera.intrinsics()).depth_m
    depth_m = np.where((depth_m > camera.min_depth_m) & (depth_m < camera.max_depth_m), depth_m, np.nan)
    return depth_to_points(depth_m.astype(np.float32), camera.intrinsics())
