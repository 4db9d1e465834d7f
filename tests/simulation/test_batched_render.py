# SPDX-License-Identifier: Apache-2.0
"""Batched rendering with torch, compared with the exact one."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from doorstate.io.camera import Intrinsics
from doorstate.simulation.batched_render import place_batch, render_batch
from doorstate.simulation.camera import CameraPose
from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.simulation.render import incidence, render
from doorstate.simulation.scene import Box
from doorstate.simulation.scene.capsule import capsule
from doorstate.types import Part

CAMERA = Intrinsics.from_hfov(80, 60, math.radians(60))
LEVEL = CameraPose(0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("preset", "tolerance"),
    [("ogurob", 1e-5), ("varied", 1e-5), ("cluttered", 1e-5), ("building", 1e-4)],  # the last with capsules
)
def test_scenes_of_one_batch_equal_exact_renderings(preset: str, tolerance: float) -> None:
    rows = [row for index in range(6) for row in draw_rows(PRESETS[preset], 2, index)]
    scenes, poses = [row.boxes() for row in rows], [row.camera_pose() for row in rows]
    batch = render_batch(place_batch(scenes, poses), CAMERA)
    differing = 0
    for number, (boxes, pose) in enumerate(zip(scenes, poses, strict=True)):
        expected = render(boxes, pose, CAMERA)
        same = batch.box[number].numpy() == expected.box
        differing += int((~same).sum())
        np.testing.assert_allclose(
            batch.depth_m[number].numpy()[same], expected.depth_m[same], rtol=tolerance
        )
        np.testing.assert_array_equal(batch.part[number].numpy()[same], expected.part[same])
        angle = incidence(expected, boxes, pose, CAMERA)
        apart = np.abs(batch.incidence_rad[number].numpy() - angle)[same]
        # On the edge of two faces, either is right.
        assert np.quantile(apart, 0.999) < 1e-3
    assert differing <= 0.002 * batch.box.numel()


def test_scenes_without_boxes_and_of_different_sizes_share_a_batch() -> None:
    wall = Box(Part.WALL, (2.5, 0.0, 0.0), (1.0, 9.0, 9.0))
    chair = Box(Part.OTHER, (1.5, 0.0, 0.0), (0.2, 0.2, 0.2))
    batch = render_batch(place_batch([[], [wall], [wall, chair, wall]], [LEVEL] * 3), CAMERA)
    assert torch.isposinf(batch.depth_m[0]).all()
    assert (batch.part[0] == Part.NONE).all()
    assert (batch.incidence_rad[0] == 0).all()
    assert (batch.depth_m[1] == 2.0).all()
    assert set(batch.box[2].unique().tolist()) == {0, 1}


def test_rays_along_faces_hit_what_is_ahead() -> None:
    camera = Intrinsics(33, 33, 16.0, 16.0, 16.0, 16.0)  # the middle ray runs along two axes
    boxes = [
        Box(Part.WALL, (2.5, 0.0, 0.0), (1.0, 1.0, 1.0)),
        Box(Part.OTHER, (2.0, 9.0, 0.0), (1.0, 1.0, 1.0)),
    ]
    batch = render_batch(place_batch([boxes], [LEVEL]), camera)
    assert batch.depth_m[0, 16, 16] == 2.0
    assert torch.isfinite(batch.incidence_rad).all()
    assert (batch.box[0].numpy() == render(boxes, LEVEL, camera).box).mean() > 0.99


def test_capsules_are_round_in_the_scenes_that_hold_them() -> None:
    column = capsule(Part.OTHER, 2.0, 0.0, (-0.5, 0.6), 0.25)
    scenes = [[column], [Box(*column)], []]
    batch = render_batch(place_batch(scenes, [LEVEL] * 3), CAMERA)
    for number, boxes in enumerate(scenes):
        expected = render(boxes, LEVEL, CAMERA)
        seen = (batch.box[number].numpy() == 0) & (expected.box == 0)
        assert (seen == (expected.box == 0)).mean() > 0.998
        np.testing.assert_allclose(batch.depth_m[number].numpy()[seen], expected.depth_m[seen], rtol=1e-4)
        angle = incidence(expected, boxes, LEVEL, CAMERA)
        np.testing.assert_allclose(batch.incidence_rad[number].numpy()[seen], angle[seen], atol=0.01)
    assert (batch.box[0] == 0).sum() < (batch.box[1] == 0).sum()
