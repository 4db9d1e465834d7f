# SPDX-License-Identifier: Apache-2.0
"""Coarse views of boxes: a few hundred rays tell what a camera would see of a scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.simulation.camera import CameraPose, DepthCamera
from doorstate.simulation.draw.layouts import PlacedCamera
from doorstate.simulation.scene.box import Box

_COLUMNS, _ROWS = 24, 18
NUM_RAYS = _COLUMNS * _ROWS
_CAMERA = DepthCamera(width=_COLUMNS, height=_ROWS)


class View(NamedTuple):
    """Depth and number of the box that each ray hits; -1 and infinity where it hits nothing."""

    depth_m: NDArray[np.float64]
    box: NDArray[np.int64]

    def share_between(self, low_m: float, high_m: float) -> float:
        """Return the share of rays that end between two depths."""
        return float(((self.depth_m > low_m) & (self.depth_m < high_m)).mean())

    def rays_on(self, numbers: Sequence[int], farthest_m: float) -> int:
        """Return the number of rays that end on some boxes."""
        return int((np.isin(self.box, numbers) & (self.depth_m < farthest_m)).sum())


def look(boxes: Sequence[Box], camera: PlacedCamera) -> View:
    """Cast the rays of a default camera with 24 x 18 pixels through all boxes but those of glass."""
    pose = CameraPose(
        *camera.pose[:2],
        camera.height_m,
        camera.pose.yaw_rad,
        math.radians(camera.pitch_deg),
        math.radians(camera.roll_deg),
    )
    intrinsics = _CAMERA.intrinsics()
    columns, rows = np.meshgrid(np.arange(_COLUMNS), np.arange(_ROWS))
    left = -(columns.ravel() - intrinsics.cx) / intrinsics.fx
    up = -(rows.ravel() - intrinsics.cy) / intrinsics.fy
    rays = np.stack([np.ones(NUM_RAYS), left, up], axis=1) @ pose.rotation().T  # (R, 3) in the plan's frame

    numbers = [number for number, box in enumerate(boxes) if box.material != "glass"]
    half = np.array([boxes[number].size_m for number in numbers]) / 2
    center = np.array([boxes[number].center_m for number in numbers])
    yaw = np.array([boxes[number].yaw_rad for number in numbers])
    offset = np.array(pose[:3]) - center
    # Boxes behind the camera are not worth a ray.
    ahead = -(offset @ pose.rotation()[:, 0]) + np.linalg.norm(half, axis=1) > 0
    half, offset, yaw = half[ahead], offset[ahead], yaw[ahead]
    cos, sin = np.cos(yaw), np.sin(yaw)
    enter, leave = np.zeros((1, 1)), np.full((1, 1), np.inf)
    axes = (
        (offset[:, 0] * cos + offset[:, 1] * sin, np.outer(rays[:, 0], cos) + np.outer(rays[:, 1], sin)),
        (offset[:, 1] * cos - offset[:, 0] * sin, np.outer(rays[:, 1], cos) - np.outer(rays[:, 0], sin)),
        (offset[:, 2], rays[:, 2:]),
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        for axis, (at, way) in enumerate(axes):
            inverse = 1.0 / way
            low, high = (-half[:, axis] - at) * inverse, (half[:, axis] - at) * inverse
            enter = np.maximum(enter, np.minimum(low, high))
            leave = np.minimum(leave, np.maximum(low, high))
    depth = np.where(enter <= leave, enter, np.inf)
    first = depth.argmin(axis=1)
    nearest = depth[np.arange(NUM_RAYS), first]
    index = np.array(numbers)[ahead][first]
    return View(nearest, np.where(np.isfinite(nearest), index, -1))
