# SPDX-License-Identifier: Apache-2.0
"""Frames of manifest rows, rendered again bit for bit."""

from __future__ import annotations

import hashlib
import math
from typing import NamedTuple

import numpy as np

from doorstate.io.depth import depth_to_points
from doorstate.simulation.noise.model import sense
from doorstate.simulation.noise.sensors import find_sensor
from doorstate.simulation.noise.streams import sample_seed
from doorstate.simulation.render import Render, render_behind_glass
from doorstate.simulation.row import Row
from doorstate.types import Points


class Frame(NamedTuple):
    """A rendered sample."""

    full: Render  # before sensor noise and range
    cut: Render  # as the depth camera reports it
    points: Points  # (H, W, 3) metres, gravity-aligned sensor frame


def replay(row: Row) -> Frame:
    """Render the frame of a manifest row, bit for bit."""
    pose, intrinsics = row.camera_pose(), row.camera.intrinsics()
    boxes, sensor = row.boxes(), find_sensor(row.sensor)
    full = render_behind_glass(boxes, pose, intrinsics)
    cut = sense(sensor, full, boxes, pose, row.camera, sample_seed(row.seed, row.sample_id))
    points = depth_to_points(cut.depth_m, intrinsics)
    return Frame(full, cut, level(points, pose.pitch_rad, pose.roll_rad))


def depth_sha256(frame: Frame) -> str:
    """Return the SHA-256 of the depth image, which tells whether a row renders as it did before."""
    return hashlib.sha256(frame.cut.depth_m.tobytes()).hexdigest()


def level(points: Points, pitch_rad: float, roll_rad: float = 0.0) -> Points:
    """Rotate the points of a tilted camera to a level sensor frame.

    Args:
        points: (..., 3) metres.
        pitch_rad: positive looks down.
        roll_rad: positive turns the camera clockwise, as seen from behind it.
    """
    if roll_rad:
        cos, sin = math.cos(roll_rad), math.sin(roll_rad)
        x, y, z = points[..., 0], points[..., 1], points[..., 2]
        points = np.stack([x, cos * y - sin * z, sin * y + cos * z], axis=-1).astype(np.float32)
    if not pitch_rad:
        return points
    cos, sin = math.cos(pitch_rad), math.sin(pitch_rad)
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    return np.stack([cos * x + sin * z, y, cos * z - sin * x], axis=-1).astype(np.float32)
