# SPDX-License-Identifier: Apache-2.0
"""Depth pixels to points in the body frame: x forward, y left, z up (ROS REP 103)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from doorstate.io.camera import Intrinsics
from doorstate.io.rotations import rotate, tilt_matrix
from doorstate.types import Points


def depth_to_points(
    depth_m: NDArray[np.floating], intrinsics: Intrinsics, roll_deg: float = 0.0, pitch_deg: float = 0.0
) -> Points:
    """Return the point of each pixel of a depth image: x = depth, y = -(u - cx) x / fx, z = -(v - cy) x / fy.

    Pixels of a distorted image are first moved to where a pinhole would show them.

    Args:
        depth_m: (H, W) depth along the viewing axis (not range), metres; NaN, infinite or <= 0 is no return.
        intrinsics: camera of the image as stored, before the roll is undone.
        roll_deg, pitch_deg: tilt of the camera, clockwise from behind and down (`rotations`).

    Returns:
        (H, W, 3) float32 points in the body frame, metres, pixel for pixel; NaN where nothing returned.

    Raises:
        CameraError: the image size is not that of the intrinsics.
    """
    with np.errstate(over="ignore"):  # overflow gives infinity, which is "not measured"
        points = np.ascontiguousarray(np.moveaxis(depth_coordinates(depth_m, intrinsics), 0, -1))
        level = rotate(points, np.array(tilt_matrix(roll_deg, pitch_deg)))
        return level.astype(np.float32, copy=False)


def depth_coordinates(depth_m: NDArray[np.floating], intrinsics: Intrinsics) -> NDArray[np.float32]:
    """Return x, y and z (3, H, W) of the points of an upright camera; arguments and errors are as above."""
    height, width = depth_m.shape
    intrinsics.check_image_size(width, height)
    depth = depth_m.astype(np.float64)
    with np.errstate(over="ignore"):
        np.copyto(depth, np.nan, where=~(np.isfinite(depth) & (depth > 0)))
        left, up = intrinsics.rays()
        if intrinsics.distortion is not None:
            depth[np.isnan(left)] = np.nan
        coordinates = np.empty((3, height, width), dtype=np.float32)
        coordinates[0] = depth
        np.multiply(depth, left, out=coordinates[1], casting="same_kind")
        np.multiply(depth, up, out=coordinates[2], casting="same_kind")
    return coordinates
