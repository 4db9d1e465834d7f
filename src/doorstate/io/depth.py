# SPDX-License-Identifier: Apache-2.0
"""From depth pixels and optical coordinates to the library's frame: x forward, y left, z up.

Frames follow ROS REP 103: optical is x right, y down, z forward; body is x forward, y left, z up.

Roll: `roll_deg` says how far the camera was turned clockwise about its viewing axis, as seen from behind it.
The viewing axis (+x) points away from that observer, so the turn is the right-handed rotation R_x(roll), and
a point measured in the turned camera is p_upright = R_x(roll) p_camera. Turned by 90 degrees, a camera sees
world-up at the left of its image: what it measures at +y (left) is up, and comes back as +z.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import CameraError
from doorstate.io.camera import Intrinsics
from doorstate.types import Points

ROLLS_DEG = (0, 90, 180, 270)


def depth_to_points(depth_m: NDArray[np.floating], intrinsics: Intrinsics, roll_deg: int = 0) -> Points:
    """Give every pixel of a depth image its point: x = depth, y = -(u - cx) x / fx, z = -(v - cy) x / fy.

    Args:
        depth_m: (H, W) depth along the viewing axis (not range), metres; NaN, infinite or <= 0 is no return.
        intrinsics: camera of the image as stored, before the roll is undone.
        roll_deg: clockwise turn of the camera, 0, 90, 180 or 270 (see the module).

    Returns:
        (H, W, 3) float32 points in the body frame, metres, pixel for pixel; NaN where nothing returned.

    Raises:
        CameraError: when the image size is not that of the intrinsics, or the roll is not a quarter turn.
    """
    height, width = depth_m.shape
    intrinsics.check_image_size(width, height)
    depth = depth_m.astype(np.float64)
    depth[~(np.isfinite(depth) & (depth > 0))] = np.nan
    points = np.empty((height, width, 3), dtype=np.float32)
    with np.errstate(over="ignore"):  # what overflows is as good as infinite: no return
        left_slope = (intrinsics.cx - np.arange(width)) / intrinsics.fx  # (W,)
        up_slope = (intrinsics.cy - np.arange(height)) / intrinsics.fy  # (H,)
        points[..., 0] = depth
        points[..., 1] = depth * left_slope
        points[..., 2] = depth * up_slope[:, None]
    return undo_roll(points, roll_deg)


def points_from_optical(points: Points) -> Points:
    """Turn (..., 3) points of the optical frame into the body frame."""
    right, down, forward = np.moveaxis(points, -1, 0)
    return np.stack((forward, -right, -down), axis=-1)


def check_roll(roll_deg: int) -> None:
    """Raise CameraError unless the roll is 0, 90, 180 or 270 degrees."""
    if roll_deg not in ROLLS_DEG:
        raise CameraError(f"a roll of {roll_deg} degrees is not 0, 90, 180 or 270")


def undo_roll(points: Points, roll_deg: int) -> Points:
    """Turn (..., 3) body-frame points of a rolled camera about x until z is up again.

    The quarter turns are written out because the sine and cosine of them are not exact in floating point.

    Raises:
        CameraError: when the roll is not 0, 90, 180 or 270 degrees.
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
