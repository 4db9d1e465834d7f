# SPDX-License-Identifier: Apache-2.0
"""Tests of doorstate.doorways.doorway."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from doorstate.doorways.doorway import Doorway
from doorstate.simulation.frames import replay
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.presets import PRESETS
from doorstate.types import Part

_places = st.floats(-5, 5)


@given(_places, _places, st.floats(-180, 180))
def test_points_return_from_the_doorway_frame(x_m: float, y_m: float, yaw_deg: float) -> None:
    points = np.random.default_rng(0).uniform(-4, 4, (50, 3)).astype(np.float32)
    doorway = Doorway(x_m, y_m, yaw_deg, 0.9, -1.0)
    assert doorway.to_sensor(doorway.to_doorway(points)) == pytest.approx(points, abs=1e-5)


def test_a_wall_ahead_has_its_robot_side_towards_the_camera() -> None:
    doorway = Doorway(x_m=2.0, y_m=0.5, yaw_deg=90.0, width_m=0.9, floor_z_m=-1.0)
    camera, left_jamb = doorway.to_doorway(np.array([[0, 0, 0], [2.0, 0.95, -1.0]], np.float32))
    assert camera == pytest.approx([-0.5, 2.0, 1.0], abs=1e-6)
    assert left_jamb == pytest.approx([0.45, 0.0, 0.0], abs=1e-6)
    assert doorway.distance_m == pytest.approx(math.hypot(2.0, 0.5))


def test_the_frame_is_the_door_frame_of_the_simulator() -> None:
    rows, _ = simulate_rows(PRESETS["varied"], seed=3, index=0)
    row = rows[0]
    pose = row.door_x_m, row.door_y_m, row.door_yaw_deg, row.opening_width_m
    x_m, y_m, yaw_deg, width_m = (value for value in pose if value is not None)
    frame = replay(row)
    doorway = Doorway(x_m, y_m, yaw_deg, width_m, -row.camera_height_m)
    points = doorway.to_doorway(frame.points)
    floor = points[frame.cut.part == Part.FLOOR]
    leaf = points[frame.cut.part == Part.LEAF]
    assert floor[:, 2] == pytest.approx(0, abs=2e-3)
    assert np.abs(np.median(leaf[:, 0])) < width_m / 2


@pytest.mark.parametrize("shape", [(3,), (1, 3), (40, 3), (5, 6, 3)])
def test_points_of_any_shape_equal_one_product(shape: tuple[int, ...]) -> None:
    doorway = Doorway(2.5, -0.3, 77.0, 0.9, -1.1)
    points = np.random.default_rng(0).normal(0, 3, shape).astype(np.float32)
    turned = doorway.to_doorway(points)
    plain = (points - np.array([2.5, -0.3, -1.1], np.float32)) @ doorway._axes().T
    assert turned.shape == shape
    assert turned.dtype == np.float32
    np.testing.assert_allclose(turned, plain, rtol=0, atol=2e-6)
