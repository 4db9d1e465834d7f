# SPDX-License-Identifier: Apache-2.0
"""Depth pixels and optical coordinates to the body frame: x forward, y left, z up.

Frames follow ROS REP 103: optical is x right, y down, z forward; body is x forward, y left, z up.

Roll: `roll_deg` is the clockwise rotation of the camera about its viewing axis, seen from behind. The viewing axis
(+x) points away from that observer, so the rotation is the right-handed R_x(roll), and a point measured by the
rolled camera is p_upright = R_x(roll) p_camera. A camera rolled by 90 degrees has world-up at the left of its
image: a point at +y (left) is up, and returned as +z.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import CameraError
from doorstate.io.camera import Intrinsics
from doorstate.types import Points

ROLLS_DEG = (0, 90, 180, 270)


def depth_to_points(depth_m: NDArray[np.floating], intrinsics: Intrinsics, roll_deg: int = 0) -> Points:
    """Return the point of each pixel of a depth image: x = depth, y = -(u - cx) x / fx, z = -(v - cy) x / fy.

    Args:
        depth_m: (H, W) depth along the viewing axis (not range), metres; NaN, infinite or <= 0 is no return.
        intrinsics: camera of the image as stored, before the roll is undone.
        roll_deg: clockwise rotation of the camera, 0, 90, 180 or 270 (see the module).

    Returns:
        (H, W, 3) float32 points in the body frame, metres, pixel for pixel; NaN where nothing returned.

    Raises:
        CameraError: the image size is not that of the intrinsics, or the roll is not a quarter turn.
    """
    height, width = depth_m.shape
    intrinsics.check_image_size(width, height)
    depth = depth_m.astype(np.float64)
    depth[~(np.isfinite(depth) & (depth > 0))] = np.nan
    points = np.empty((height, width, 3), dtype=np.float32)
    with np.errstate(over="ignore"):  # overflow gives infinity, which is "not measured"
        left_slope = (intrinsics.cx - np.arange(width)) / intrinsics.fx  # (W,)
        up_slope = (intrinsics.cy - np.arange(height)) / intrinsics.fy  # (H,)
        points[..., 0] = depth
        points[..., 1] = depth * left_slope
        points[..., 2] = depth * up_slope[:, None]
    return undo_roll(points, roll_deg)


def points_from_optical(points: Points) -> Points:
    """Transform points (..., 3) from the optical frame to the body frame."""
    right, down, forward = np.moveaxis(points, -1, 0)
    return np.stack((forward, -right, -down), axis=-1)


def check_roll(roll_deg: int) -> None:
    """Check that a roll is a quarter turn.

    Raises:
        CameraError: it is not.
    """
    if roll_deg not in ROLLS_DEG:
        raise CameraError(
            f"{roll_deg} degrees is not a quarter turn", field="roll_deg", expected="0, 90, 180 or 270"
        )


def undo_roll(points: Points, roll_deg: int) -> Points:
    """Rotate body-frame points (..., 3) of a rolled camera about x, so that z is up.

    Quarter turns are written out because their sines and cosines are not exact in floating point.

    Raises:
        CameraError: the roll is not 0, 90, 180 or 270 degrees.
    """
    check_roll(roll_deg)
    forward, left, up = np.moveaxis(points, -1, 0)
    match roll_deg:
        case 0:
            return points
        case 90:
            upright = (forward, -up, left)
        case 180:
            upright = (forward, -left, -up)
        case _:
            upright = (forward, up, -left)
    return np.stack(upright, axis=-1)
