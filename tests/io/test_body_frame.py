# SPDX-License-Identifier: Apache-2.0
"""Stored numbers to points: scales, frames, cameras of another resolution."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from doorstate.errors import CameraError
from doorstate.io.body_frame import points_from_depth, points_in_body
from doorstate.io.camera import Intrinsics, Pinhole
from doorstate.io.options import ReadOptions

CAMERA = Intrinsics(20, 4, fx=16.0, fy=16.0, cx=9.5, cy=1.5)
DEPTH_MM = np.arange(500, 580, dtype=np.uint16).reshape(4, 20)


def test_depth_without_a_camera() -> None:
    with pytest.raises(CameraError) as caught:
        points_from_depth(DEPTH_MM, ReadOptions())
    assert "intrinsics" in caught.value.suggestions


def test_a_pinhole_fits_every_image_size() -> None:
    pinhole = Pinhole(CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy)
    expected = points_from_depth(DEPTH_MM, ReadOptions(intrinsics=CAMERA)).points
    np.testing.assert_array_equal(
        points_from_depth(DEPTH_MM, ReadOptions(intrinsics=pinhole)).points, expected
    )


@pytest.mark.parametrize(
    "camera",
    [
        Pinhole(2 * CAMERA.fx, 2 * CAMERA.fy, 2 * CAMERA.cx, 2 * CAMERA.cy),
        Intrinsics.from_hfov(640, 480, 1.0),
    ],
)
def test_a_camera_of_another_resolution_is_refused(camera: Pinhole | Intrinsics) -> None:
    with pytest.raises(CameraError, match="20 x 4") as caught:
        points_from_depth(DEPTH_MM, ReadOptions(intrinsics=camera))
    assert caught.value.field == "intrinsics"


def test_the_unit_of_clouds_is_refused_for_integer_depth() -> None:
    centimetres = ReadOptions(intrinsics=CAMERA, units_m=0.01)
    with pytest.raises(CameraError) as caught:
        points_from_depth(DEPTH_MM, centimetres)
    assert caught.value.suggestions == {"depth_scale_m": 0.01}
    assert points_from_depth(DEPTH_MM, replace(centimetres, depth_scale_m=0.01)).points.shape == (4, 20, 3)


def test_signalling_nan_and_overflow_are_not_measured_and_do_not_warn() -> None:
    signalling = np.full((4, 20), 0x7FA00000, np.uint32).view(np.float32)
    for stored in (signalling, np.full((4, 20), 3e38, np.float32)):
        depth = points_from_depth(stored, ReadOptions(intrinsics=CAMERA, units_m=1000.0)).points
        assert not np.isfinite(depth).any()
        assert not np.isfinite(points_in_body(stored[:, :3], ReadOptions(units_m=1000.0)).points).any()
