# SPDX-License-Identifier: Apache-2.0
"""Frames of manifest rows, rendered again bit for bit."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from doorstate.io.depth import depth_coordinates
from doorstate.simulation.noise.conditions import INDOORS
from doorstate.simulation.noise.model import sense
from doorstate.simulation.noise.sensors import find_sensor
from doorstate.simulation.noise.streams import sample_seed
from doorstate.simulation.render import Render, render_states
from doorstate.simulation.row import Row
from doorstate.types import Points


class Frame(NamedTuple):
    """A rendered sample."""

    full: Render  # before sensor noise and range
    cut: Render  # as the depth camera reports it
    points: Points  # (H, W, 3) metres, gravity-aligned sensor frame, up to the camera's bias


def replay(row: Row) -> Frame:
    """Render the frame of a manifest row, bit for bit."""
    return replay_pose([row])[0]


def replay_pose(rows: Sequence[Row]) -> list[Frame]:
    """Render frames of one camera pose as `replay` does; what all of them show is rendered once."""
    camera, pose, intrinsics = rows[0].camera, rows[0].camera_pose(), rows[0].camera.intrinsics()
    states = [row.boxes() for row in rows]
    frames = []
    for row, boxes, full in zip(rows, states, render_states(states, pose, intrinsics), strict=True):
        seed = sample_seed(row.seed, row.sample_id)
        conditions = row.conditions or INDOORS
        cut = sense(find_sensor(row.sensor), full, boxes, pose, camera, seed, conditions)
        pitch_rad, roll_rad = pose.pitch_rad, pose.roll_rad
        if row.bias is not None:
            cut = cut._replace(depth_m=cut.depth_m * np.float32(row.bias.depth_factor))
            pitch_rad, roll_rad = map(math.radians, row.told_tilt_deg())
        x_y_z = depth_coordinates(cut.depth_m, intrinsics)
        frames.append(Frame(full, cut, level(np.moveaxis(x_y_z, 0, -1), pitch_rad, roll_rad)))
    return frames


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
    x, y, z = np.moveaxis(points, -1, 0)
    if roll_rad:
        cos, sin = math.cos(roll_rad), math.sin(roll_rad)
        y, z = cos * y - sin * z, sin * y + cos * z
    if pitch_rad:
        cos, sin = math.cos(pitch_rad), math.sin(pitch_rad)
        x, z = cos * x + sin * z, cos * z - sin * x
    elif not roll_rad:
        return points
    # Each coordinate contiguous in memory, as geometry wants it (`clouds.coordinates`).
    return np.moveaxis(np.stack([x, y, z]).astype(np.float32, copy=False), 0, -1)
