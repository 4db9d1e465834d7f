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
    height, width = depth_m.shape
    intrinsics.check_image_size(width, height)
    depth = depth_m.astype(np.float64)
    depth[~(np.isfinite(depth) & (depth > 0))] = np.nan
    points = np.empty((height, width, 3), dtype=np.float32)
    with np.errstate(over="ignore"):  # overflow gives infinity, which is "not measured"
        left, up = intrinsics.rays()
        if intrinsics.distortion is not None:
            depth[np.isnan(left)] = np.nan
        points[..., 0] = depth
        points[..., 1] = depth * left
        points[..., 2] = depth * up
        level = rotate(points, np.array(tilt_matrix(roll_deg, pitch_deg)))
        return level.astype(np.float32, copy=False)
