# SPDX-License-Identifier: Apache-2.0
"""Depth to points: pixels computed by hand, the frames of REP 103, and rolled cameras."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from numpy.typing import NDArray

from doorstate.errors import CameraError
from doorstate.io.camera import Intrinsics
from doorstate.io.depth import depth_to_points
from doorstate.io.sensor_pose import camera_pose

SMALL = Intrinsics(width=4, height=3, fx=2.0, fy=4.0, cx=1.5, cy=1.0)
ROLLS = (0, 90, 180, 270)

_cameras = st.builds(
    Intrinsics,
    width=st.integers(1, 9),
    height=st.integers(1, 9),
    fx=st.floats(1, 900),
    fy=st.floats(1, 900),
    cx=st.floats(-5, 15),
    cy=st.floats(-5, 15),
)


@st.composite
def _frames(draw: st.DrawFn) -> tuple[NDArray[np.float32], Intrinsics]:
    camera = draw(_cameras)
    values = st.floats(0.125, 16, width=32) | st.sampled_from([0.0, np.nan, np.inf, -1.0])
    return draw(npst.arrays(np.float32, (camera.height, camera.width), elements=values)), camera


def test_pixels_computed_by_hand() -> None:
    points = depth_to_points(np.full((3, 4), 2.0), SMALL)
    assert points.shape == (3, 4, 3)
    assert points.dtype == np.float32
    # Pixel u = 0, v = 0 is 1.5 px left of and 1 px above the centre: y = 1.5 * 2 / 2, z = 1 * 2 / 4.
    assert points[0, 0].tolist() == [2.0, 1.5, 0.5]
    # Pixel u = 3, v = 2: 1.5 px right, 1 px below.
    assert points[2, 3].tolist() == [2.0, -1.5, -0.5]


def test_missing_depth_is_nan_and_the_input_is_unchanged() -> None:
    depth_m = np.array(
        [[np.nan, 0.0, -1.0, np.inf], [-np.inf, 1.0, 1.0, 1.0], [1.0, 1.0, 1.0, 1.0]], np.float32
    )
    before = depth_m.copy()
    points = depth_to_points(depth_m, SMALL)
    np.testing.assert_array_equal(np.isnan(points).all(axis=-1).ravel(), [True] * 5 + [False] * 7)
    assert np.isfinite(points.reshape(-1, 3)[5:]).all()
    np.testing.assert_array_equal(depth_m, before)


@given(_frames())
@settings(max_examples=100)
def test_equals_the_inverse_camera_matrix_in_the_optical_frame(
    frame: tuple[NDArray[np.float32], Intrinsics],
) -> None:
    depth_m, k = frame
    valid = np.isfinite(depth_m) & (depth_m > 0)
    v, u = np.nonzero(valid)
    matrix = np.array([[k.fx, 0, k.cx], [0, k.fy, k.cy], [0, 0, 1]])
    optical = np.linalg.solve(matrix, np.stack([u, v, np.ones(len(u))]) * depth_m[valid]).T
    points = depth_to_points(depth_m, k)
    np.testing.assert_allclose(
        points[valid], camera_pose("optical").to_body(optical.astype(np.float32)), 1e-5, 1e-6
    )
    assert np.isnan(points[~valid]).all()


@given(_frames())
@settings(max_examples=50)
def test_is_the_plain_loop_in_float64_bit_for_bit(frame: tuple[NDArray[np.float32], Intrinsics]) -> None:
    depth_m, k = frame
    points = depth_to_points(depth_m, k)
    for v, u in np.ndindex(depth_m.shape):
        depth = float(depth_m[v, u])
        if 0 < depth < np.inf:
            expected = [depth, depth * ((k.cx - u) / k.fx), depth * ((k.cy - v) / k.fy)]
            np.testing.assert_array_equal(points[v, u], np.array(expected).astype(np.float32))


def test_overflow_is_infinite_and_does_not_warn() -> None:
    camera = Intrinsics(width=4, height=3, fx=1e-300, fy=1.0, cx=1e300, cy=1e300)
    points = depth_to_points(np.full((3, 4), 2.0, np.float32), camera)
    assert np.isinf(points[..., 1:]).all()


def test_optical_axes_become_body_axes() -> None:
    right, down, forward = np.eye(3, dtype=np.float32)
    body = camera_pose("optical").to_body(np.stack([right, down, forward]))
    np.testing.assert_array_equal(body, [[0, -1, 0], [0, 0, -1], [1, 0, 0]])


def test_a_camera_turned_clockwise_by_90_degrees_sees_up_at_the_left() -> None:
    # The only return is at the left edge, half way down: up in the world.
    camera = Intrinsics(3, 3, fx=1.0, fy=1.0, cx=1.0, cy=1.0)
    depth_m = np.full((3, 3), np.nan)
    depth_m[1, 0] = 2.0
    assert depth_to_points(depth_m, camera, roll_deg=90)[1, 0].tolist() == [2.0, 0.0, 2.0]
    # Upside down the left edge is the right of the world, turned the other way it is the floor.
    assert depth_to_points(depth_m, camera, roll_deg=180)[1, 0].tolist() == [2.0, -2.0, 0.0]
    assert depth_to_points(depth_m, camera, roll_deg=270)[1, 0].tolist() == [2.0, 0.0, -2.0]


@given(_frames(), st.sampled_from(ROLLS))
@settings(max_examples=100)
def test_a_turned_camera_measures_the_same_points(
    frame: tuple[NDArray[np.float32], Intrinsics], roll_deg: int
) -> None:
    depth_m, k = frame
    turned, camera = depth_m, k
    for _ in range(roll_deg // 90):
        # A clockwise quarter turn of the camera turns its image counter-clockwise: (u, v) -> (v, W - 1 - u).
        turned = np.rot90(turned)
        camera = Intrinsics(
            camera.height, camera.width, camera.fy, camera.fx, camera.cy, camera.width - 1 - camera.cx
        )
    points = depth_to_points(turned, camera, roll_deg)
    np.testing.assert_allclose(points, np.rot90(depth_to_points(depth_m, k), roll_deg // 90), 1e-4, 1e-5)


def test_another_image_size_is_a_camera_error() -> None:
    with pytest.raises(CameraError, match=r"3 x 4 .* 4 x 3"):
        depth_to_points(np.ones((4, 3)), SMALL)
