# SPDX-License-Identifier: Apache-2.0
"""Axes, tilt and quaternions against SciPy."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from doorstate.errors import CameraError
from doorstate.io.rotations import (
    AXES,
    axes_matrix,
    heading_and_tilt_deg,
    heading_matrix,
    parse_axes,
    parse_quaternion,
    quaternion_matrix,
    rotate,
    tilt_matrix,
)

ANGLES_DEG = st.floats(-360, 360) | st.sampled_from([-270, -90, 0, 90, 180, 360])
QUATERNIONS = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda quaternion: np.linalg.norm(quaternion) > 0.1)


@given(ANGLES_DEG, ANGLES_DEG, ANGLES_DEG)
def test_tilt_is_pitch_about_y_after_roll_about_x(
    roll_deg: float, pitch_deg: float, heading_deg: float
) -> None:
    expected = Rotation.from_euler("ZYX", [heading_deg, pitch_deg, roll_deg], degrees=True).as_matrix()
    matrix = np.array(heading_matrix(heading_deg)) @ np.array(tilt_matrix(roll_deg, pitch_deg))
    np.testing.assert_allclose(matrix, expected, atol=1e-12)


@given(st.floats(-179, 179), st.floats(-79, 79), st.floats(-179, 179))
def test_heading_and_tilt_are_found_again(heading_deg: float, pitch_deg: float, roll_deg: float) -> None:
    matrix = Rotation.from_euler("ZYX", [heading_deg, pitch_deg, roll_deg], degrees=True).as_matrix()
    found = heading_and_tilt_deg(matrix)
    np.testing.assert_allclose(found, (heading_deg, pitch_deg, roll_deg), atol=1e-6)


@given(QUATERNIONS)
def test_quaternions_are_those_of_scipy(numbers: tuple[float, ...]) -> None:
    x, y, z, w = np.array(numbers) / np.linalg.norm(numbers)
    expected = Rotation.from_quat([x, y, z, w]).as_matrix()
    np.testing.assert_allclose(quaternion_matrix((x, y, z, w)), expected, atol=1e-12)


def test_a_camera_that_looks_down_sees_the_floor_ahead() -> None:
    # 30 degrees down, 1 m high: the floor on the optical axis is 2 m away.
    level = rotate(np.array([[2.0, 0.0, 0.0]]), np.array(tilt_matrix(0, 30)))
    np.testing.assert_allclose(level, [[3**0.5, 0, -1]], atol=1e-12)


def test_quarter_turns_move_numbers_without_changing_them() -> None:
    points = np.random.default_rng(0).normal(size=(2, 5, 3)).astype(np.float32)
    for axes in map("".join, permutations("flu")):
        if np.linalg.det(axes_matrix(axes)) > 0:
            turned = rotate(points, np.array(axes_matrix(axes)))
            assert turned.dtype == np.float32
            assert set(turned.ravel()) == set(points.ravel())
    np.testing.assert_array_equal(rotate(points, np.array(tilt_matrix(180, 0)))[..., 1], -points[..., 1])


def test_half_of_all_axes_are_right_handed_and_the_others_are_refused() -> None:
    right_handed = 0
    for letters in map("".join, product("fblrud", repeat=3)):
        if np.linalg.det(axes_matrix(letters)) > 0:
            right_handed += 1
            assert parse_axes(letters.upper()) == letters
        else:
            with pytest.raises(CameraError) as caught:
                parse_axes(letters)
            assert caught.value.field == "axes"
    assert right_handed == 24
    assert {parse_axes(name) for name in AXES} == {"flu", "rdf", "rub"}
    for name in ("sideways", "", "fl", "fluu", "xyz"):
        with pytest.raises(CameraError):
            parse_axes(name)


@pytest.mark.parametrize("text", ["0 0.5 0 0.866", "[0, 0.5, 0, 0.866]", "0,0.5,0,0.866", " (0.0; 0.5) "])
def test_quaternions_as_text(text: str) -> None:
    if ";" in text:
        with pytest.raises(CameraError, match="four numbers"):
            parse_quaternion(text)
    else:
        assert parse_quaternion(text) == (0, 0.5, 0, 0.866)


def test_what_is_no_rotation_is_refused() -> None:
    for quaternion in ((0, 0, 0, 0), (0, 0, 0, 2), (np.nan, 0, 0, 1), (np.inf, 0, 0, 1)):
        with pytest.raises(CameraError) as caught:
            quaternion_matrix(quaternion)
        assert caught.value.field == "quaternion"
    with pytest.raises(CameraError, match="85 degrees down"):
        heading_and_tilt_deg(np.array(tilt_matrix(0, 85)))
