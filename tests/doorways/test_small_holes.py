# SPDX-License-Identifier: Apache-2.0
"""Tests of doorstate.doorways.small_holes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from doorstate.doorways.small_holes import _short_runs, _small_holes, fill_small_holes
from doorstate.types import Points

_CAMERA_M = np.array([0.3, 2.5, 1.0], np.float32)


def _wall(depth_m: float = 0.0, slope: float = 0.0) -> Points:
    """Return a dense wall, as deep as said and turned about the vertical."""
    x, z = np.meshgrid(np.arange(-1.2, 1.2, 0.016), np.arange(0.0, 2.3, 0.016))
    points = np.stack([x, slope * x - depth_m, z], axis=-1).reshape(-1, 3)
    return points.astype(np.float32)


def _without(points: Points, x_m: tuple[float, float], z_m: tuple[float, float]) -> Points:
    x, z = points[:, 0], points[:, 2]
    return points[~((x > x_m[0]) & (x < x_m[1]) & (z > z_m[0]) & (z < z_m[1]))]


@pytest.mark.parametrize(("depth_m", "slope"), [(0.0, 0.0), (0.1, 0.0), (0.05, 0.2)])
def test_a_small_hole_is_filled_on_the_plane_around_it(depth_m: float, slope: float) -> None:
    cloud = _without(_wall(depth_m, slope), (0.18, 0.37), (0.88, 1.12))
    points, nearest = fill_small_holes(cloud, _CAMERA_M)
    assert 4 <= len(points) <= 20
    assert points[:, 1] == pytest.approx(slope * points[:, 0] - depth_m, abs=1e-3)
    assert (points[:, 0] > 0.12).all()
    assert (points[:, 0] < 0.41).all()
    assert np.linalg.norm(cloud[nearest] - points, axis=1).max() < 0.2
    assert len(fill_small_holes(np.concatenate([cloud, points]), _CAMERA_M).points) == 0


def test_a_wall_without_holes_gets_no_points() -> None:
    assert len(fill_small_holes(_wall(), _CAMERA_M).points) == 0
    sparse = np.random.default_rng(0).permutation(_wall())[:6000]
    assert len(fill_small_holes(sparse, _CAMERA_M).points) == 0


@pytest.mark.parametrize(
    ("x_m", "z_m"), [((0.0, 0.4), (0.9, 1.1)), ((0.2, 0.36), (0.8, 1.3)), ((0.2, 0.36), (0.0, 2.3))]
)
def test_large_holes_and_gaps_stay(x_m: tuple[float, float], z_m: tuple[float, float]) -> None:
    assert len(fill_small_holes(_without(_wall(), x_m, z_m), _CAMERA_M).points) == 0


def test_a_hole_beside_a_step_stays() -> None:
    wall = _wall()
    wall[wall[:, 0] > 0.28, 1] -= 0.06
    assert len(fill_small_holes(_without(wall, (0.2, 0.36), (0.9, 1.1)), _CAMERA_M).points) == 0


def test_no_points_and_no_wall_before_the_camera() -> None:
    assert len(fill_small_holes(np.empty((0, 3), np.float32), _CAMERA_M).points) == 0
    behind = np.array([0.0, -1.0, 1.0], np.float32)
    assert len(fill_small_holes(_wall(), behind).points) == 0


def _plain_short_runs(empty: np.ndarray, most: int) -> np.ndarray:
    """Return the short runs by a loop over all pairs of filled cells."""
    short = np.zeros_like(empty)
    for column in range(empty.shape[1]):
        filled = np.flatnonzero(~empty[:, column]).tolist()
        for first, second in pairwise(filled):
            if second - first - 1 <= most:
                short[first + 1 : second, column] = True
    return short


@given(st.integers(0, 10_000), st.floats(0.05, 0.9), st.integers(1, 4))
def test_short_runs_equal_those_of_a_loop(seed: int, share: float, most: int) -> None:
    empty = np.random.default_rng(seed).random((12, 9)) < share
    assert (_short_runs(empty, most) == _plain_short_runs(empty, most)).all()


def test_cells_of_a_hole_are_in_order() -> None:
    counts = np.ones((9, 8), np.int64)
    counts[2:4, 3:5] = counts[6, 2] = counts[6, 5:7] = 0
    assert _small_holes(counts) == [[(2, 3), (2, 4), (3, 3), (3, 4)], [(6, 5), (6, 6)]]
