# SPDX-License-Identifier: Apache-2.0
"""Glass: hit or seen through; and the angle at which a ray meets what it hits."""

from __future__ import annotations

import math

import numpy as np

from doorstate.clouds.camera import Intrinsics
from doorstate.simulation.scene import Box
from doorstate.simulation.sensor import (
    NO_BOX,
    CameraPose,
    DepthCamera,
    cut_range,
    incidence,
    is_made_of,
    render,
    render_behind_glass,
)
from doorstate.types import Part

CAMERA = Intrinsics.from_hfov(33, 25, math.radians(70))
AHEAD = CameraPose(0.0, 0.0, 0.0, 0.0)
PANE = Box(Part.LEAF, (1.0, 0.0, 0.0), (0.01, 1.0, 9.0), material="glass")
WALL = Box(Part.WALL, (3.0, 0.0, 0.0), (0.2, 9.0, 9.0))


def test_a_pane_is_hit_or_seen_through() -> None:
    boxes = [PANE, WALL]
    hit, through = (cast(boxes, AHEAD, CAMERA) for cast in (render, render_behind_glass))
    glass = is_made_of("glass", hit, boxes)
    assert 0.2 < glass.mean() < 0.8
    np.testing.assert_allclose(hit.depth_m[glass], 0.995, rtol=1e-6)
    assert (hit.part[glass] == Part.LEAF).all()
    np.testing.assert_allclose(through.depth_m, 2.9, rtol=1e-6)
    assert (through.part == Part.WALL).all()
    assert (through.box == 1).all()  # boxes keep their numbers
    assert not is_made_of("glass", through, boxes).any()
    np.testing.assert_array_equal(hit.depth_m[~glass], through.depth_m[~glass])


def test_what_is_out_of_range_is_no_box_of_any_material() -> None:
    cut = cut_range(render([PANE, WALL], AHEAD, CAMERA), DepthCamera(min_depth_m=1.5))
    assert ((cut.box == NO_BOX) == np.isnan(cut.depth_m)).all()
    assert not is_made_of("glass", cut, [PANE, WALL]).any()


def test_rays_meet_a_facing_wall_at_their_angle_from_the_axis_and_a_floor_at_its_complement() -> None:
    left = (np.arange(33) - CAMERA.cx)[None, :] / CAMERA.fx
    up = (CAMERA.cy - np.arange(25))[:, None] / CAMERA.fy
    length = np.sqrt(1 + left**2 + up**2)
    found = incidence(render([WALL], AHEAD, CAMERA), [WALL], AHEAD, CAMERA)
    np.testing.assert_allclose(found, np.arccos(1 / length), atol=1e-6)
    floor = Box(Part.FLOOR, (0.0, 0.0, -1.05), (50.0, 50.0, 0.1))
    seen = render([floor], AHEAD, CAMERA)
    found = incidence(seen, [floor], AHEAD, CAMERA)
    below = np.isfinite(seen.depth_m)
    np.testing.assert_allclose(found[below], np.arccos(-up / length)[below], atol=1e-6)
    assert (found[~below] == 0).all()
