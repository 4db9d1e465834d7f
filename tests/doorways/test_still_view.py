# SPDX-License-Identifier: Apache-2.0
"""Frames of a still camera."""

from __future__ import annotations

import math

import numpy as np

from doorstate.clouds.stillness import coarse_rays
from doorstate.doorways.doorway import Doorway
from doorstate.doorways.still_view import is_still, rays_through
from doorstate.io.rotations import tilt_matrix
from doorstate.simulation.frames import Frame
from doorstate.types import Points

DOORWAY = Doorway(3.0, 0.0, 90.0, 0.9, -1.0)


def wall_with_a_leaf(angle_deg: float) -> Points:
    """Return an image of a wall 3 m ahead with a leaf that is hinged at y = -0.45 m and opens towards the camera."""
    left, up = np.meshgrid(np.linspace(0.8, -0.8, 160), np.linspace(0.6, -0.6, 120))
    depth_m = np.full(left.shape, 3.0)
    cos, sin = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    # The ray (1, left, up) meets the leaf, hinge + r (-sin, cos), at this distance from the hinge.
    reach_m = (3 * left + 0.45) / (cos + sin * left)
    on_leaf = (reach_m >= 0) & (reach_m <= 0.9)
    depth_m[on_leaf] = (3.0 - reach_m * sin)[on_leaf]
    return (depth_m[..., None] * np.stack([np.ones_like(left), left, up], axis=-1)).astype(np.float32)


def test_a_leaf_that_turns_is_noticed() -> None:
    shut = coarse_rays(wall_with_a_leaf(0))
    assert is_still(shut, coarse_rays(wall_with_a_leaf(2)), [DOORWAY])
    ajar = coarse_rays(wall_with_a_leaf(9))
    assert not is_still(shut, ajar, [DOORWAY])
    assert not is_still(shut, coarse_rays(wall_with_a_leaf(60)))
    elsewhere = Doorway(3.0, 1.8, 90.0, 0.9, -1.0)
    assert is_still(shut, coarse_rays(wall_with_a_leaf(6)), [elsewhere])


def test_doors_are_in_the_level_frame_and_rays_as_measured() -> None:
    rotation = np.array(tilt_matrix(0, 20))
    clouds = [wall_with_a_leaf(angle) @ rotation.astype(np.float32) for angle in (0, 9)]
    assert not is_still(*map(coarse_rays, clouds), [DOORWAY], rotation)


def test_simulated_states_differ(frames: list[Frame]) -> None:
    closed, semi_open, _ = (coarse_rays(frame.points) for frame in frames)
    assert is_still(closed, closed)
    assert not is_still(closed, semi_open)


def test_rays_through_an_opening() -> None:
    points = np.array(
        [
            [6.0, 0.0, 0.0],
            [1.5, 0.2, 0.4],
            [6.0, 1.2, 0.0],
            [6.0, 0.0, 2.2],
            [6.0, 0.0, -2.2],
            [-3, 0, 0],
            [np.nan] * 3,
        ],
        np.float32,
    )
    assert rays_through(DOORWAY, points).tolist() == [True, True, False, False, False, False, False]
    assert not is_still(coarse_rays(points[:0]), coarse_rays(points[:0]))
