# SPDX-License-Identifier: Apache-2.0
"""A depth camera that looks at boxes: exact slab test (Kay & Kajiya 1986), each box only over its own pixels.

A ray is `origin + t * direction` with the direction scaled so that t is z-depth, as a depth camera reports it. Along
each axis of a box the direction is linear in the pixel's column and row; for a level camera it depends on one of the
two only, and NumPy's broadcasting then keeps that axis one-dimensional.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from doorstate.clouds.camera import Intrinsics
from doorstate.simulation.scene import Box
from doorstate.types import DepthImage, Part

_NEAR_M = 0.01  # corners closer than this cannot be projected


class DepthCamera(BaseModel):
    """A pinhole depth camera; the defaults are the ASUS Xtion Pro as Gazebo's `openni_kinect` plugin simulates it.

    Image 640x480, 60 degrees, valid strictly between 0.4 and 5.0 m (SIMULATION section 1.2).
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    width: int = 640
    height: int = 480
    hfov_deg: float = 60.0
    min_depth_m: float = 0.4
    max_depth_m: float = 5.0

    def intrinsics(self) -> Intrinsics:
        """The pinhole of Gazebo: f = W / (2 tan(hfov / 2)), centre ((W - 1) / 2, (H - 1) / 2)."""
        return Intrinsics.from_hfov(self.width, self.height, math.radians(self.hfov_deg))


CAMERAS = {
    "xtion-gazebo": DepthCamera(),
    "xtion-hw": DepthCamera(hfov_deg=58.0, min_depth_m=0.8, max_depth_m=3.5),
}


class CameraPose(NamedTuple):
    """Where the camera is in the door frame; yaw about z, then pitch about y, positive pitch looks down (as SDF)."""

    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float
    pitch_rad: float = 0.0

    def rotation(self) -> NDArray[np.float64]:
        """R_door_camera, (3, 3); camera axes x forward, y left, z up."""
        # math, not numpy: libm gives the same bits whatever SIMD the processor has.
        cos_yaw, sin_yaw = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        cos_pitch, sin_pitch = math.cos(self.pitch_rad), math.sin(self.pitch_rad)
        return np.array(
            [
                [cos_yaw * cos_pitch, -sin_yaw, cos_yaw * sin_pitch],
                [sin_yaw * cos_pitch, cos_yaw, sin_yaw * sin_pitch],
                [-sin_pitch, 0.0, cos_pitch],
            ]
        )


class Render(NamedTuple):
    """What the camera sees before its range is cut."""

    depth_m: DepthImage  # (H, W) z-depth, inf where nothing is hit
    part: NDArray[np.uint8]  # (H, W) doorstate.types.Part, NONE where nothing is hit


def render(boxes: Sequence[Box], pose: CameraPose, intrinsics: Intrinsics) -> Render:
    """Cast one ray per pixel against all boxes; of two surfaces at the same depth the earlier box wins.

    Returns:
        Depth (H, W) float32 in metres and part (H, W) uint8.
    """
    shape = (intrinsics.height, intrinsics.width)
    depth = np.full(shape, np.inf)
    part = np.full(shape, Part.NONE, dtype=np.uint8)
    for box in boxes:
        _cast_box(box, pose, intrinsics, depth, part)
    return Render(depth.astype(np.float32), part)


def cut_range(rendered: Render, camera: DepthCamera) -> Render:
    """Depth is NaN and part NONE unless min < depth < max, both strict, as in the Gazebo plugin."""
    with np.errstate(invalid="ignore"):
        valid = (rendered.depth_m > camera.min_depth_m) & (rendered.depth_m < camera.max_depth_m)
    depth = np.where(valid, rendered.depth_m, np.float32(np.nan))
    return Render(depth, np.where(valid, rendered.part, np.uint8(Part.NONE)))


def _cast_box(
    box: Box, pose: CameraPose, intrinsics: Intrinsics, depth: NDArray[np.float64], part: NDArray[np.uint8]
) -> None:
    cos, sin = math.cos(box.yaw_rad), math.sin(box.yaw_rad)
    rotation_box_door = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    rotation = rotation_box_door @ pose.rotation()  # R_box_camera
    offset = np.array([pose.x_m, pose.y_m, pose.z_m]) - np.array(box.center_m)
    origin = rotation_box_door @ offset
    half = np.array(box.size_m) / 2

    rows, columns = _pixel_window(rotation, origin, half, intrinsics)
    if rows.start >= rows.stop or columns.start >= columns.stop:
        return
    left = -(np.arange(columns.start, columns.stop) - intrinsics.cx)[None, :] / intrinsics.fx  # (1, w)
    up = -(np.arange(rows.start, rows.stop) - intrinsics.cy)[:, None] / intrinsics.fy  # (h, 1)

    enter: NDArray[np.float64] = np.full((1, 1), _NEAR_M)
    leave: NDArray[np.float64] = np.full((1, 1), np.inf)
    # Level axes first: they stay one-dimensional until the last.
    for axis in range(3):
        direction = _direction(rotation[axis], left, up)
        # A ray along a face divides by zero: +-inf is the right answer, and 0/0 (on the face) counts as a miss.
        with np.errstate(divide="ignore", invalid="ignore"):
            one = (-half[axis] - origin[axis]) / direction
            other = (half[axis] - origin[axis]) / direction
        enter = np.maximum(enter, np.minimum(one, other))
        leave = np.minimum(leave, np.maximum(one, other))
    window = depth[rows, columns]
    hit = (enter <= leave) & (enter < window)
    # A camera inside a box would enter at the near limit; our rooms have none.
    np.copyto(window, enter, where=hit)
    part[rows, columns][hit] = box.part


def _direction(
    row: NDArray[np.float64], left: NDArray[np.float64], up: NDArray[np.float64]
) -> NDArray[np.float64]:
    direction = np.full((1, 1), row[0])
    if row[1]:
        direction = direction + row[1] * left
    if row[2]:
        direction = direction + row[2] * up
    return direction


def _pixel_window(
    rotation: NDArray[np.float64],
    origin: NDArray[np.float64],
    half: NDArray[np.float64],
    intrinsics: Intrinsics,
) -> tuple[slice, slice]:
    """Rows and columns that can see the box; the whole image when a corner is beside or behind the camera."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = (signs * half - origin) @ rotation  # (8, 3) in the camera's frame
    forward = corners[:, 0]
    if (forward < _NEAR_M).all():
        return slice(0, 0), slice(0, 0)
    if (forward < _NEAR_M).any():
        return slice(0, intrinsics.height), slice(0, intrinsics.width)
    u = intrinsics.cx - corners[:, 1] / forward * intrinsics.fx
    v = intrinsics.cy - corners[:, 2] / forward * intrinsics.fy
    return _clip(v, intrinsics.height), _clip(u, intrinsics.width)


def _clip(pixels: NDArray[np.float64], size: int) -> slice:
    start = min(max(math.floor(pixels.min()), 0), size)
    return slice(start, max(min(math.ceil(pixels.max()) + 1, size), start))
