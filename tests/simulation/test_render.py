# SPDX-License-Identifier: Apache-2.0
"""Rendering, compared with a plain loop over rays and boxes, and with walls at known distances."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from doorstate.io.camera import Intrinsics
from doorstate.io.depth import depth_to_points
from doorstate.simulation.camera import CAMERAS, CameraPose, DepthCamera
from doorstate.simulation.render import Render, cut_range, render
from doorstate.simulation.scene import Box
from doorstate.types import Part
from tests.simulation import naive_caster

CAMERA = Intrinsics.from_hfov(18, 14, math.radians(70))
LEVEL = CameraPose(0.0, 0.0, 0.0, 0.0)


def random_boxes(rng: np.random.Generator, pose: CameraPose, count: int) -> list[Box]:
    """Return boxes around the camera; none of them contains it."""
    boxes = []
    while len(boxes) < count:
        size, center = rng.uniform(0.05, 2.0, 3), rng.uniform(-3, 3, 3) + pose[:3]
        yaw = float(rng.uniform(-4, 4)) if rng.random() < 0.8 else 0.0
        offset = naive_caster.turn_z(tuple(pose[:3] - center), -yaw)
        if (np.abs(offset) > size / 2 + 0.05).any():
            part = Part(int(rng.integers(6)))
            boxes.append(Box(part, tuple(center.tolist()), tuple(size.tolist()), yaw))
    return boxes


@given(seed=st.integers(0, 2**32 - 1), is_level=st.booleans())
@settings(max_examples=60)
def test_rendering_equals_a_loop_over_rays_and_boxes(seed: int, is_level: bool) -> None:
    rng = np.random.default_rng(seed)
    x, y, z, yaw, pitch = rng.uniform(-3, 3, 5).tolist()
    pose = CameraPose(x, y, z, yaw, 0.0 if is_level else pitch / 2)
    boxes = random_boxes(rng, pose, 6)
    depth, part = naive_caster.cast(boxes, pose, CAMERA)
    rendered = render(boxes, pose, CAMERA)
    assert rendered.depth_m.dtype == np.float32
    np.testing.assert_allclose(rendered.depth_m, depth, rtol=1e-6)
    np.testing.assert_array_equal(rendered.part, part)


def test_a_wall_two_metres_away_is_two_metres_away_in_every_pixel() -> None:
    wall = Box(Part.WALL, (2.5, 0.0, 0.0), (1.0, 100.0, 100.0))
    rendered = render([wall], LEVEL, CAMERA)
    assert (rendered.depth_m == 2.0).all()
    assert (rendered.part == Part.WALL).all()
    points = depth_to_points(rendered.depth_m, CAMERA)
    # Half the image width is W / 2 pixels of f = W / (2 tan(hfov / 2)); the outermost centre is half a pixel inside.
    assert points[0, 0] == pytest.approx(
        (2.0, 2 * 17 / 18 * math.tan(math.radians(35)), 2 * 13 / 18 * math.tan(math.radians(35)))
    )
    assert (points[0, 0, 1:] == -points[-1, -1, 1:]).all()


def test_positive_pitch_looks_down_and_positive_yaw_to_the_left() -> None:
    below = Box(Part.FLOOR, (0.0, 0.0, -1.5), (50.0, 50.0, 1.0))
    tilted = render([below], CameraPose(0, 0, 0, 0, math.pi / 2), CAMERA)
    np.testing.assert_allclose(tilted.depth_m, 1.0, rtol=1e-6)
    on_the_left = Box(Part.OTHER, (0.0, 3.0, 0.0), (1.0, 1.0, 9.0))
    assert (render([on_the_left], LEVEL, CAMERA).part == Part.NONE).all()
    turned = render([on_the_left], CameraPose(0, 0, 0, math.pi / 2), CAMERA)
    assert turned.depth_m.min() == pytest.approx(2.5)


def test_boxes_behind_the_camera_are_clipped() -> None:
    behind = Box(Part.OTHER, (-2.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    assert np.isinf(render([behind], LEVEL, CAMERA).depth_m).all()
    # A wall on the left from 2 m behind to 3 m ahead: a ray of slope s meets it at z = 1 / s.
    beside = Box(Part.WALL, (0.5, 1.5, 0.0), (5.0, 1.0, 9.0))
    rendered = render([beside], LEVEL, CAMERA)
    slope = (CAMERA.cx - np.arange(CAMERA.width)) / CAMERA.fx
    with np.errstate(divide="ignore"):
        expected = np.where((slope > 0) & (1 / slope < 3), 1 / slope, np.inf)
    assert np.isfinite(expected).sum() in range(1, 9)
    np.testing.assert_allclose(rendered.depth_m, np.tile(expected, (CAMERA.height, 1)), rtol=1e-6)


def test_the_nearer_surface_wins_and_the_first_at_equal_depth() -> None:
    first = Box(Part.FRAME, (2.5, 0.0, 0.0), (1.0, 9.0, 9.0))
    second = first._replace(part=Part.LEAF)
    nearer = Box(Part.OTHER, (1.5, 0.0, 0.0), (0.5, 9.0, 9.0))
    assert (render([first, second], LEVEL, CAMERA).part == Part.FRAME).all()
    assert (render([first, nearer, second], LEVEL, CAMERA).part == Part.OTHER).all()


def test_an_empty_scene_is_infinitely_far() -> None:
    rendered = render([], LEVEL, CAMERA)
    assert np.isposinf(rendered.depth_m).all()
    assert (rendered.part == Part.NONE).all()


_LIMITS = np.array(
    [
        0.4,
        np.nextafter(np.float32(0.4), np.float32(1)),
        5.0,
        np.nextafter(np.float32(5), np.float32(0)),
        np.nan,
    ],
    np.float32,
)


@given(depth=npst.arrays(np.float32, 5, elements=st.floats(0, 10, width=32) | st.just(math.inf)))
@example(depth=_LIMITS)
@settings(max_examples=50)
def test_the_range_excludes_its_limits(depth: np.ndarray) -> None:
    parts = np.arange(5, dtype=np.uint8)
    cut = cut_range(Render(depth[None], parts[None], parts[None].astype(np.int16)), DepthCamera())
    for before, after, part, number in zip(depth, cut.depth_m[0], cut.part[0], range(5), strict=True):
        if np.float32(0.4) < before < np.float32(5.0):
            assert (after, part) == (before, number)
        else:
            assert np.isnan(after)
            assert part == Part.NONE


def test_cameras_have_the_intrinsics_of_the_plugin_and_the_data_sheet() -> None:
    gazebo, hardware = CAMERAS["xtion-gazebo"].intrinsics(), CAMERAS["xtion-hw"].intrinsics()
    assert (gazebo.width, gazebo.height, gazebo.cx, gazebo.cy) == (640, 480, 319.5, 239.5)
    assert gazebo.fx == gazebo.fy == pytest.approx(554.256258422)
    assert hardware.fx == pytest.approx(577.3, abs=0.05)
