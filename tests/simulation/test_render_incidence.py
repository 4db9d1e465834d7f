# SPDX-License-Identifier: Apache-2.0
"""Incidence, materials and glass of renderings; cameras off centre."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.io.camera import Intrinsics
from doorstate.simulation.camera import CameraPose, DepthCamera
from doorstate.simulation.render import NO_BOX, cut_range, incidence, is_made_of, render, render_behind_glass
from doorstate.simulation.scene import Box
from doorstate.types import Part
from tests.simulation import naive_caster

CAMERA = Intrinsics.from_hfov(18, 14, math.radians(70))
LEVEL = CameraPose(0.0, 0.0, 0.0, 0.0)
WALL = Box(Part.WALL, (3.5, 0.0, 0.0), (1.0, 50.0, 50.0))
PANE = Box(Part.LEAF, (2.0, 0.0, 0.0), (0.01, 1.0, 50.0), material="glass")


def angle_to_face(box: Box, pose: CameraPose, row: int, column: int, depth_m: float) -> float:
    """Return the angle to the face nearest to the hit point, computed in the box's frame."""
    ray = naive_caster.pixel_ray(row, column, pose, CAMERA)
    hit = tuple(a + depth_m * b - c for a, b, c in zip(pose[:3], ray, box.center_m, strict=True))
    local, direction = (naive_caster.turn_z(vector, -box.yaw_rad) for vector in (hit, ray))
    gaps = [abs(abs(at) - size / 2) for at, size in zip(local, box.size_m, strict=True)]
    face = gaps.index(min(gaps))
    return math.acos(abs(direction[face]) / math.hypot(*direction))


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_incidence_is_the_angle_between_the_ray_and_the_face_it_hits(seed: int) -> None:
    rng = np.random.default_rng(seed)
    yaw, pitch = rng.uniform(-1, 1, 2).tolist()
    pose = CameraPose(0.1, -0.2, 0.3, yaw, pitch / 2)
    boxes = [
        Box(
            Part.OTHER, tuple(rng.uniform(-4, 4, 3)), tuple(rng.uniform(0.5, 3, 3)), float(rng.uniform(-4, 4))
        )
        for _ in range(5)
    ]
    inside = [(np.abs(np.array(pose[:3]) - box.center_m) < 3).all() for box in boxes]
    boxes = [box for box, holds_camera in zip(boxes, inside, strict=True) if not holds_camera]
    rendered = render(boxes, pose, CAMERA)
    angles = incidence(rendered, boxes, pose, CAMERA)
    assert ((angles >= 0) & (angles <= np.float32(math.pi / 2))).all()
    for row, column in np.argwhere(rendered.box != NO_BOX).tolist():
        box = boxes[rendered.box[row, column]]
        expected = angle_to_face(box, pose, row, column, float(rendered.depth_m[row, column]))
        # At an edge of the box either face is right, because depth is float32.
        assert angles[row, column] == pytest.approx(expected, abs=1e-4) or on_edge(
            rendered.depth_m, row, column, box, pose
        )
    assert (angles[rendered.box == NO_BOX] == 0).all()


def on_edge(depth_m: np.ndarray, row: int, column: int, box: Box, pose: CameraPose) -> bool:
    ray = naive_caster.pixel_ray(row, column, pose, CAMERA)
    hit = tuple(
        a + float(depth_m[row, column]) * b - c for a, b, c in zip(pose[:3], ray, box.center_m, strict=True)
    )
    local = naive_caster.turn_z(hit, -box.yaw_rad)
    return sum(abs(abs(at) - size / 2) < 1e-4 for at, size in zip(local, box.size_m, strict=True)) > 1


def test_incidence_of_a_wall_ahead_is_the_angle_off_the_axis() -> None:
    angles = incidence(render([WALL], LEVEL, CAMERA), [WALL], LEVEL, CAMERA)
    right = (np.arange(18) - CAMERA.cx)[None, :] / CAMERA.fx
    down = (np.arange(14) - CAMERA.cy)[:, None] / CAMERA.fy
    np.testing.assert_allclose(angles, np.arctan(np.hypot(right, down)), atol=1e-6)


def test_incidence_of_a_floor_is_the_complement_of_the_ray_below_the_horizon() -> None:
    floor = Box(Part.FLOOR, (0.0, 0.0, -1.05), (50.0, 50.0, 0.1))
    rendered = render([floor], LEVEL, CAMERA)
    angles = incidence(rendered, [floor], LEVEL, CAMERA)
    right = (np.arange(18) - CAMERA.cx)[None, :] / CAMERA.fx
    up = (CAMERA.cy - np.arange(14))[:, None] / CAMERA.fy
    below = np.isfinite(rendered.depth_m)
    np.testing.assert_allclose(
        angles[below], np.arccos(-up / np.sqrt(1 + right**2 + up**2))[below], atol=1e-6
    )
    assert (angles[~below] == 0).all()


def test_glass_is_replaced_by_the_opaque_surface_behind_it() -> None:
    boxes = [PANE, WALL]
    front, behind = render(boxes, LEVEL, CAMERA), render_behind_glass(boxes, LEVEL, CAMERA)
    pane = is_made_of("glass", front, boxes)
    assert 0.2 < pane.mean() < 0.8
    assert (front.depth_m[pane] == np.float32(1.995)).all()
    assert (front.part[pane] == Part.LEAF).all()
    assert (front.box == np.where(pane, 0, 1)).all()
    assert (behind.depth_m == 3).all()
    assert (behind.part == Part.WALL).all()
    assert (behind.box == 1).all()
    np.testing.assert_array_equal(front.depth_m[~pane], behind.depth_m[~pane])
    assert not is_made_of("glass", behind, boxes).any()


def test_glass_nearer_than_the_range_is_cut() -> None:
    boxes = [PANE, WALL]
    cut = cut_range(render(boxes, LEVEL, CAMERA), DepthCamera(min_depth_m=2.5))
    assert is_made_of("glass", render(boxes, LEVEL, CAMERA), boxes).any()
    assert ((cut.box == NO_BOX) == np.isnan(cut.depth_m)).all()
    assert not is_made_of("glass", cut, boxes).any()


def test_pixels_out_of_range_have_neither_box_nor_material() -> None:
    boxes = [PANE, WALL]
    cut = cut_range(render(boxes, LEVEL, CAMERA), DepthCamera(max_depth_m=2.5))
    lost = np.isnan(cut.depth_m)
    assert 0 < lost.sum() < lost.size
    assert ((cut.box == NO_BOX) == lost).all()
    assert ((cut.part == Part.NONE) == lost).all()
    assert (is_made_of("matte", cut, boxes) == 0).all()


def test_cameras_off_centre_keep_their_centre() -> None:
    camera = DepthCamera(cx_px=300.25, cy_px=17.0)
    assert (camera.intrinsics().cx, camera.intrinsics().cy) == (300.25, 17.0)
    assert camera.intrinsics().fx == DepthCamera().intrinsics().fx
    assert DepthCamera.model_validate(camera.model_dump()) == camera
