# SPDX-License-Identifier: Apache-2.0
"""Rendering with rolled and pitched cameras, and levelling of their points."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.io.camera import Intrinsics
from doorstate.io.depth import depth_to_points
from doorstate.simulation.camera import CameraPose
from doorstate.simulation.frames import level
from doorstate.simulation.render import render
from doorstate.simulation.scene import Box
from doorstate.types import Part
from tests.simulation import naive_caster

CAMERA = Intrinsics.from_hfov(18, 14, math.radians(70))
angles = st.floats(-0.6, 0.6)


@given(yaw=st.floats(-3, 3), pitch=angles, roll=angles)
@settings(max_examples=40)
def test_a_tilted_camera_equals_a_loop_over_rays_and_boxes(yaw: float, pitch: float, roll: float) -> None:
    boxes = [
        Box(Part.FLOOR, (0.0, 0.0, -1.05), (20.0, 20.0, 0.1)),
        Box(Part.OTHER, (2.0, 0.3, 0.0), (0.4, 0.8, 1.0), 0.4),
        Box(Part.WALL, (-1.0, 3.0, 0.2), (3.0, 0.2, 2.0), -0.2),
    ]
    pose = CameraPose(0.0, 0.0, 0.0, yaw, pitch, roll)
    depth, part = naive_caster.cast(boxes, pose, CAMERA)
    rendered = render(boxes, pose, CAMERA)
    np.testing.assert_allclose(rendered.depth_m, depth, rtol=1e-6)
    np.testing.assert_array_equal(rendered.part, part)


@given(pitch=st.floats(0, 0.6), roll=angles)
@settings(max_examples=40)
def test_levelled_points_of_a_floor_lie_on_the_floor(pitch: float, roll: float) -> None:
    floor = Box(Part.FLOOR, (0.0, 0.0, -1.05), (50.0, 50.0, 0.1))
    rendered = render([floor], CameraPose(0.0, 0.0, 0.0, 0.7, pitch, roll), CAMERA)
    points = level(depth_to_points(rendered.depth_m, CAMERA), pitch, roll)
    heights = points[np.isfinite(rendered.depth_m)][:, 2]
    assert len(heights) > 30
    np.testing.assert_allclose(heights, -1.0, atol=1e-5)


def test_a_positive_roll_turns_the_camera_clockwise() -> None:
    on_the_left = Box(Part.OTHER, (3.0, 1.0, 0.0), (1.0, 0.5, 0.5))
    level_camera = CameraPose(0.0, 0.0, 0.0, 0.0)
    rows, columns = np.nonzero(render([on_the_left], level_camera, CAMERA).part == Part.OTHER)
    assert columns.mean() < CAMERA.cx
    assert rows.mean() == pytest.approx(CAMERA.cy)
    # Turned clockwise by a quarter, a camera has its upper edge on the right, and sees below what was at its left.
    turned = render([on_the_left], level_camera._replace(roll_rad=math.pi / 2), CAMERA)
    rows, columns = np.nonzero(turned.part == Part.OTHER)
    assert rows.mean() > CAMERA.cy
    assert columns.mean() == pytest.approx(CAMERA.cx)


def test_zero_roll_keeps_the_rotation_bit_for_bit() -> None:
    pose = CameraPose(1.0, 2.0, 1.0, 0.3, 0.2)
    assert pose._replace(roll_rad=0.0).rotation().tobytes() == pose.rotation().tobytes()
    nearly = pose._replace(roll_rad=1e-300).rotation()
    np.testing.assert_allclose(nearly, pose.rotation(), atol=1e-200)
    assert CameraPose.from_degrees((1.0, 2.0, 1.0), 180.0, 90.0) == (1.0, 2.0, 1.0, math.pi, math.pi / 2, 0.0)
