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
from doorstate.simulation.scene.box import Box, Pose

FINE = DepthCamera(width=24, height=18)
COARSE = DepthCamera(width=12, height=9)
_WIDEST = math.tan(math.radians(DepthCamera().hfov_deg / 2))  # half of the view's width at a depth of 1
_HIGHEST = _WIDEST * FINE.height / FINE.width
_SLACK = math.hypot(1.0, _WIDEST)


class View(NamedTuple):
    """Depth and number of the box that each ray hits; -1 and infinity where it hits nothing."""

    depth_m: NDArray[np.float64]
    box: NDArray[np.int64]

    def share_between(self, low_m: float, high_m: float) -> float:
        """Return the share of rays that end between two depths."""
        return float(((self.depth_m > low_m) & (self.depth_m < high_m)).mean())

    def share_on(self, numbers: Sequence[int], farthest_m: float) -> float:
        """Return the share of rays that end on some boxes, up to a depth."""
        return float((np.isin(self.box, numbers) & (self.depth_m < farthest_m)).mean())


def shows_rectangle(
    camera: PlacedCamera, frame: Pose, width_m: float, heights_m: tuple[float, float]
) -> float:
    """Return the share of a rectangle on a wall that is inside the image, hidden or not.

    Args:
        camera: the camera.
        frame: frame of the wall with its origin below the middle of the rectangle.
        width_m: width of the rectangle.
        heights_m: height of its lower and upper edge.
    """
    across, height = np.meshgrid(np.linspace(-0.5, 0.5, 7) * width_m, np.linspace(*heights_m, 7))
    cos, sin = math.cos(frame.yaw_rad), math.sin(frame.yaw_rad)
    points = np.stack([frame.x_m + across * cos, frame.y_m + across * sin, height], axis=-1).reshape(-1, 3)
    pose = _pose(camera)
    forward, left, up = ((points - np.array(pose[:3])) @ pose.rotation()).T
    inside = (np.abs(left) < forward * _WIDEST) & (np.abs(up) < forward * _HIGHEST)
    return float(inside.mean())


def look(boxes: Sequence[Box], camera: PlacedCamera, image: DepthCamera = FINE) -> View:
    """Cast the rays of a small image against the boxes, without those of glass; capsules count as boxes."""
    pose = _pose(camera)
    intrinsics, count = image.intrinsics(), image.width * image.height
    columns, rows = np.meshgrid(np.arange(image.width), np.arange(image.height))
    left = -(columns.ravel() - intrinsics.cx) / intrinsics.fx
    up = -(rows.ravel() - intrinsics.cy) / intrinsics.fy
    rays = np.stack([np.ones(count), left, up], axis=1) @ pose.rotation().T  # (R, 3) in the plan's frame

    numbers = [number for number, box in enumerate(boxes) if box.material != "glass"]
    half = np.array([boxes[number].size_m for number in numbers]) / 2
    center = np.array([boxes[number].center_m for number in numbers])
    yaw = np.array([boxes[number].yaw_rad for number in numbers])
    offset = np.array(pose[:3]) - center
    # Boxes behind the camera or beside its view are not worth a ray.
    forward, left_m, up_m = -(offset @ pose.rotation()).T
    slack = np.linalg.norm(half, axis=1) * _SLACK + forward * _WIDEST
    ahead = (forward + np.linalg.norm(half, axis=1) > 0) & (np.abs(left_m) < slack) & (np.abs(up_m) < slack)
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
    nearest = depth[np.arange(count), first]
    index = np.array(numbers)[ahead][first]
    return View(nearest, np.where(np.isfinite(nearest), index, -1))


def _pose(camera: PlacedCamera) -> CameraPose:
    return CameraPose(
        *camera.pose[:2],
        camera.height_m,
        camera.pose.yaw_rad,
        math.radians(camera.pitch_deg),
        math.radians(camera.roll_deg),
    )
