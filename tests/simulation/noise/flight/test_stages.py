# SPDX-License-Identifier: Apache-2.0
"""Multipath in corners, and wiggling along the distance."""

from __future__ import annotations

import numpy as np
import pytest
from paper.measurements.sensors import AHEAD, wall

from doorstate.io.camera import Intrinsics
from doorstate.simulation.noise.conditions import Conditions
from doorstate.simulation.noise.flight.multipath import Multipath, multipath_bias
from doorstate.simulation.noise.flight.wiggling import Wiggling, wiggle
from doorstate.simulation.noise.model import distort
from doorstate.simulation.noise.optical import View, cosines, ray_lengths
from doorstate.simulation.noise.sensors import SENSORS
from doorstate.simulation.render import render_behind_glass
from doorstate.simulation.scene import Box
from doorstate.types import Part

CAMERA = Intrinsics.from_hfov(160, 120, np.radians(75))
SIDE = Box(Part.WALL, (0.0, -1.5, 0.0), (20.0, 1.0, 20.0))  # its face is 1 m to the right


def bias_mm(
    boxes: list[Box], albedo: float, columns: int = 24
) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    view = View(render_behind_glass(boxes, AHEAD, CAMERA), boxes, AHEAD, CAMERA, 0)
    cosine = cosines(view, ray_lengths(CAMERA))
    grey = np.full(cosine.shape, albedo, np.float32)
    return 1000 * multipath_bias(view, grey, cosine, Multipath(columns=columns))


def test_a_plane_has_no_multipath_and_a_corner_is_measured_too_far() -> None:
    assert bias_mm([wall(2.5)], 0.8).max() == 0
    corner = bias_mm([wall(2.5), SIDE], 0.8)
    assert corner.min() >= 0
    assert 20 < corner[60].max() < 150
    # The wall ahead: more towards the corner than away from it.
    assert corner[60, 60] > 1.5 * corner[60, 5] > 0
    assert bias_mm([wall(2.5), SIDE], 0.1)[60].max() < corner[60].max() / 4


def test_multipath_hardly_depends_on_the_size_of_patches() -> None:
    coarse, fine = (bias_mm([wall(2.5), SIDE], 0.8, columns)[60] for columns in (24, 45))
    apart = np.abs(coarse - fine)
    assert np.median(apart) < 2
    assert coarse.max() == pytest.approx(fine.max(), rel=0.15)


def test_wiggling_repeats_and_has_no_mean() -> None:
    wiggling = Wiggling(amplitude_m=0.006, period_m=0.3)
    distance = np.linspace(1, 1.3, 301, dtype=np.float32)[None, :-1]
    error = wiggle(distance, wiggling, np.random.default_rng(1))
    again = wiggle(distance + np.float32(0.6), wiggling, np.random.default_rng(1))
    np.testing.assert_allclose(error, again, atol=2e-7 / 0.3)
    assert np.abs(error).max() == pytest.approx(0.006, rel=0.01)
    assert error.mean() == pytest.approx(0, abs=1e-5)


def test_noise_grows_on_dark_surfaces_and_edges_have_flying_pixels() -> None:
    model = SENSORS["kinect-2"]
    pinhole = Intrinsics.from_hfov(120, 90, np.radians(40))
    deviations = []
    for material in ("matte", "dark"):
        boxes = [wall(1.5, material=material)]
        rendered = render_behind_glass(boxes, AHEAD, pinhole)
        images = [
            distort(model, rendered, boxes, AHEAD, pinhole, seed).depth_m[40:50, 55:65] for seed in range(8)
        ]
        deviations.append(np.mean([np.nanstd(image) for image in images]))
    assert deviations[1] > 4 * deviations[0]
    boxes = [Box(Part.LEAF, (2.0, -5.0, 0.0), (0.02, 10.0, 20.0)), wall(3.0)]
    rendered = render_behind_glass(boxes, AHEAD, pinhole)
    depth_m = distort(model, rendered, boxes, AHEAD, pinhole, 0, Conditions()).depth_m
    flying = (depth_m > 2.1) & (depth_m < 2.9)
    assert 0.2 < flying[:, 59:61].mean() < 0.9
    assert not flying[:, 62:].any()
    assert not flying[:, :58].any()
