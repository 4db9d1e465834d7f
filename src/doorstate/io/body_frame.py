# SPDX-License-Identifier: Apache-2.0
"""Stored numbers to points in metres in the body frame."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import CameraError
from doorstate.io.camera import Intrinsics, Pinhole
from doorstate.io.depth import depth_to_points
from doorstate.io.options import ReadOptions
from doorstate.io.sensor_pose import PosedCloud, pose_in_map
from doorstate.io.viewpoint import Viewpoint

# Some recorders write the largest 16-bit value where nothing was measured; others write 0.
_NOT_MEASURED = 65535


def points_in_body(
    stored: NDArray[Any], options: ReadOptions, *, frame_id: str = "", viewpoint: Viewpoint | None = None
) -> PosedCloud:
    """Return stored points (..., 3) in metres and in the body frame.

    Args:
        stored: points as stored.
        options: axes, tilt and units.
        frame_id: frame in the header of a message.
        viewpoint: pose of the camera in the frame of the points, if they are not in the frame of the camera.

    Raises:
        CameraError: a pose that cannot be used.
    """
    pose = options.pose(frame_id)
    if viewpoint is not None and not options.ignore_viewpoint:
        x, y, z = (number * options.units_m for number in viewpoint.position)
        pose = pose_in_map(pose, viewpoint._replace(position=(x, y, z)))
    with np.errstate(over="ignore", invalid="ignore"):  # overflow gives infinity, which is "not measured"
        return PosedCloud(pose.to_body(stored.astype(np.float64) * options.units_m), pose)


def points_from_depth(stored: NDArray[Any], options: ReadOptions) -> PosedCloud:
    """Return the points (H, W, 3) of a stored depth image (H, W), in metres and in the body frame.

    Raises:
        CameraError: no intrinsics, or those of another image size.
    """
    pose = options.pose(is_depth=True)
    height, width = stored.shape
    intrinsics = options.intrinsics
    if intrinsics is None:
        raise CameraError(
            f"a depth image ({width} x {height} pixels) needs the intrinsics of its camera",
            suggestions={"intrinsics": None},
        )
    if isinstance(intrinsics, Pinhole):
        intrinsics = _fit_to_image(intrinsics, width, height)
    scale_m = _metres_per_unit(stored.dtype.kind == "f", options)
    with np.errstate(invalid="ignore"):  # a signalling NaN is a NaN
        depth_m = stored.astype(np.float64) * scale_m
    if stored.dtype.newbyteorder("=") == np.uint16:
        depth_m[stored == _NOT_MEASURED] = np.nan
    points = depth_to_points(depth_m, intrinsics, pose.roll_deg, pose.pitch_deg)
    return PosedCloud(points, pose)


def _fit_to_image(camera: Pinhole, width: int, height: int) -> Intrinsics:
    """Return the camera with the size of an image; its centre reveals numbers of another resolution."""
    if not (width / 4 <= camera.cx <= width * 3 / 4 and height / 4 <= camera.cy <= height * 3 / 4):
        raise CameraError(
            f"cx = {camera.cx:g}, cy = {camera.cy:g} are far from the centre of an image of {width} x {height} pixels",
            field="intrinsics",
            expected="the camera at this resolution (of a cropped image, with its width and height)",
        )
    return Intrinsics(width, height, *camera)


def _metres_per_unit(is_float: bool, options: ReadOptions) -> float:
    """Return the metres per unit of integer or floating point depth images.

    Raises:
        CameraError: only the scale of the other kind is set.
    """
    if is_float:
        return options.units_m
    if options.units_m not in (1.0, options.depth_scale_m):
        raise CameraError(
            "integer depth has its own scale, not the unit of clouds",
            suggestions={"depth_scale_m": options.units_m},
        )
    return options.depth_scale_m
