# SPDX-License-Identifier: Apache-2.0
"""Shaded pictures: parts in their colours, lit by their slope."""

from __future__ import annotations

import math

import numpy as np

from doorstate.io.camera import Intrinsics
from doorstate.simulation.render import Render
from doorstate.simulation.shading import shade
from doorstate.types import Part

CAMERA = Intrinsics.from_hfov(32, 24, math.radians(60))
BOX = np.zeros((24, 32), np.int16)


def test_a_wall_that_faces_the_camera_is_evenly_lit() -> None:
    wall = Render(np.full((24, 32), 2.0, np.float32), np.full((24, 32), Part.WALL, np.uint8), BOX)
    picture = shade(wall, CAMERA)
    assert (picture.shape, picture.dtype) == ((24, 32, 3), np.uint8)
    # The lamp stands at (-0.75, 0.45, 0.48), the wall's normal is -x.
    light = 0.45 + 0.55 * 0.75 / math.sqrt(0.75**2 + 0.45**2 + 0.48**2)
    expected = np.array([226, 221, 208]) * light
    assert np.abs(picture - expected).max() <= 1


def test_parts_differ_and_nothing_is_background() -> None:
    depth = np.full((24, 32), 2.0, np.float32)
    part = np.full((24, 32), Part.WALL, np.uint8)
    part[:, 10:20] = Part.LEAF
    depth[:, 20:], part[:, 20:] = np.inf, Part.NONE
    picture = shade(Render(depth, part, BOX), CAMERA)
    assert (picture[:, 20:] == (28, 32, 40)).all()
    assert len(np.unique(picture[:, [2, 12, 25]].reshape(-1, 3), axis=0)) == 3


def test_faces_of_another_slope_are_lit_differently() -> None:
    slanted = np.tile(np.linspace(2, 3, 32, dtype=np.float32), (24, 1))
    leaf = np.full((24, 32), Part.LEAF, np.uint8)
    flat = shade(Render(np.full_like(slanted, 2.0), leaf, BOX), CAMERA)
    assert np.abs(shade(Render(slanted, leaf, BOX), CAMERA)[12, 16].astype(int) - flat[12, 16]).max() > 5
