# SPDX-License-Identifier: Apache-2.0
"""Rendering by faces, compared bit for bit with a slab test of every box in every pixel."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.io.camera import Intrinsics
from doorstate.simulation.box_faces import place_boxes
from doorstate.simulation.camera import CameraPose
from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.simulation.render import incidence, render, render_behind_glass, render_states
from doorstate.simulation.scene import Box
from doorstate.simulation.z_buffer import ZBuffer, box_of
from doorstate.types import Part
from tests.simulation.plain_render import plain_render
from tests.simulation.test_render import random_boxes

CAMERA = Intrinsics.from_hfov(64, 48, math.radians(70))
LEVEL = CameraPose(0.0, 0.0, 0.0, 0.0)


def assert_same(boxes: list[Box], pose: CameraPose, camera: Intrinsics) -> None:
    expected, rendered = plain_render(boxes, pose, camera), render(boxes, pose, camera)
    np.testing.assert_array_equal(rendered.depth_m, expected.depth_m)
    np.testing.assert_array_equal(rendered.box, expected.box)
    np.testing.assert_array_equal(incidence(rendered, boxes, pose, camera), expected.incidence_rad)


@given(seed=st.integers(0, 2**32 - 1), tilt=st.sampled_from(["level", "pitch", "roll"]))
@settings(max_examples=60)
def test_faces_give_the_bits_of_a_slab_test(seed: int, tilt: str) -> None:
    rng = np.random.default_rng(seed)
    x, y, z, yaw, pitch, roll = rng.uniform(-1, 1, 6).tolist()
    pose = CameraPose(x, y, z, 3 * yaw, 0.0 if tilt == "level" else pitch, roll if tilt == "roll" else 0.0)
    assert_same(random_boxes(rng, pose, 12), pose, CAMERA)


@pytest.mark.parametrize("preset", ["ogurob", "varied", "cluttered", "two-doors"])
def test_scenes_of_presets_give_the_bits_of_a_slab_test(preset: str) -> None:
    for index in range(4):
        row = draw_rows(PRESETS[preset], 5, index)[0]
        assert_same(row.boxes(), row.camera_pose(), CAMERA)


def test_edges_through_the_middles_of_pixels_are_decided_by_the_slab_test() -> None:
    # The face at x = 2 reaches from -1 to 1 along y and z; with f = 16, its edges lie on columns and rows 8 and 24.
    camera = Intrinsics(33, 33, 16.0, 16.0, 16.0, 16.0)
    box = Box(Part.WALL, (2.5, 0.0, 0.0), (1.0, 2.0, 2.0))
    assert_same([box], LEVEL, camera)
    assert (render([box], LEVEL, camera).box == 0).sum() == 17 * 17
    # Half a turn and boxes side by side: edges in common, and rays along faces.
    boxes = [
        box,
        box._replace(center_m=(2.5, 2.0, 0.0)),
        box._replace(center_m=(2.5, -2.0, 0.0), yaw_rad=math.pi),
    ]
    assert_same([*boxes, *boxes], LEVEL, camera)
    assert_same([box._replace(center_m=(3.0, 1.0, 1.0))], LEVEL, camera)


def test_a_box_around_the_camera_is_not_seen() -> None:
    around = Box(Part.OTHER, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    assert (render([around], LEVEL, CAMERA).box == -1).all()


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_boxes_may_be_drawn_in_any_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    boxes = random_boxes(rng, LEVEL, 5)
    boxes += boxes[:3]  # the same depth
    placed = place_boxes(boxes, LEVEL)
    expected, buffer = ZBuffer(placed, CAMERA), ZBuffer(placed, CAMERA)
    expected.draw_boxes(range(len(boxes)))
    for number in rng.permutation(len(boxes)).tolist():
        buffer.draw_boxes([number])
    np.testing.assert_array_equal(buffer.depth_m, expected.depth_m)
    np.testing.assert_array_equal(buffer.face, expected.face)


def test_a_drawn_surface_hides_what_is_behind_it() -> None:
    boxes = [
        Box(Part.WALL, (3.0, 0.0, 0.0), (1.0, 9.0, 9.0)),
        Box(Part.OTHER, (2.0, 0.0, 0.0), (0.5, 0.5, 0.5)),
    ]
    buffer = ZBuffer(place_boxes(boxes, LEVEL), CAMERA)
    buffer.draw_boxes([0])
    rows, columns = slice(10, 20), slice(5, 60)
    depth_m = np.full((10, 55), 2.0)
    depth_m[:, :5], depth_m[:, 5:10] = np.inf, 2.5  # missed, and as far as the wall, which comes first
    buffer.draw(1, rows, columns, depth_m)
    assert (box_of(buffer.face) == 1).sum() == 10 * 45
    assert (buffer.depth_m[rows, 15:60] == 2.0).all()


@pytest.mark.parametrize("preset", ["varied", "corridor"])
def test_states_of_a_pose_equal_single_renderings(preset: str) -> None:
    panes = 0
    for index in range(8):
        rows = draw_rows(PRESETS[preset], 4, index)
        pose, states = rows[0].camera_pose(), [row.boxes() for row in rows]
        for boxes, rendered in zip(states, render_states(states, pose, CAMERA), strict=True):
            opaque = [number for number, box in enumerate(boxes) if box.material != "glass"]
            expected = plain_render(boxes, pose, CAMERA, opaque)
            np.testing.assert_array_equal(rendered.depth_m, expected.depth_m)
            np.testing.assert_array_equal(rendered.box, expected.box)
            everything = plain_render(boxes, pose, CAMERA).box
            is_glass = np.array([box.material == "glass" for box in boxes] + [False])
            pane = np.zeros(everything.shape, np.bool_) if rendered.pane is None else rendered.pane
            np.testing.assert_array_equal(pane, is_glass[everything])
            panes += int(pane.any())
    assert panes > 0


def test_states_with_boxes_of_other_numbers_are_rendered_alone() -> None:
    wall = Box(Part.WALL, (3.0, 0.0, 0.0), (1.0, 9.0, 9.0))
    leaf = Box(Part.LEAF, (2.0, 0.0, 0.0), (0.1, 1.0, 1.0))
    both, alone = render_states([[wall, leaf], [wall]], LEVEL, CAMERA)
    assert (both.part == Part.LEAF).any()
    np.testing.assert_array_equal(alone.depth_m, render_behind_glass([wall], LEVEL, CAMERA).depth_m)
