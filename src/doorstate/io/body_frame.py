# SPDX-License-Identifier: Apache-2.0
"""Stored numbers to points in metres in the body frame."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import CameraError
from doorstate.io.camera import Intrinsics, Pinhole
from doorstate.io.depth import depth_to_points, points_from_optical, undo_roll
from doorstate.io.options import ReadOptions
from doorstate.types import Points

# Some recorders write the largest 16-bit value where nothing was measured; others write 0.
_NOT_MEASURED = 65535


def points_in_body(stored: NDArray[Any], options: ReadOptions) -> Points:
    """Return stored points (..., 3) in metres and in the body frame."""
    with np.errstate(over="ignore", invalid="ignore"):  # overflow gives infinity, which is "not measured"
        points = (stored.astype(np.float64) * options.units_m).astype(np.float32)
    if options.frame == "optical":
        points = points_from_optical(points)
    return undo_roll(points, options.roll_deg)


def points_from_depth(stored: NDArray[Any], options: ReadOptions) -> Points:
    """Return the points (H, W, 3) of a stored depth image (H, W), in metres and in the body frame.

    Raises:
        CameraError: no intrinsics, or those of another image size.
    """
    height, width = stored.shape
    intrinsics = options.intrinsics
    if intrinsics is None:
        raise CameraError(
            f"a depth image ({width} x {height} pixels) needs the intrinsics of its camera",
            field="intrinsics",
            suggestions={"intrinsics": None},
        )
    if isinstance(intrinsics, Pinhole):
        intrinsics = _fit_to_image(intrinsics, width, height)
    scale_m = _metres_per_unit(stored.dtype.kind == "f", options)
    with np.errstate(invalid="ignore"):  # a signalling NaN is a NaN
        depth_m = stored.astype(np.float64) * scale_m
    if stored.dtype.newbyteorder("=") == np.uint16:
        depth_m[stored == _NOT_MEASURED] = np.nan
    return depth_to_points(depth_m, intrinsics, options.roll_deg)


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
