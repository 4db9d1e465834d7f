# SPDX-License-Identifier: Apache-2.0
"""Points that stay after thinning."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from doorstate.clouds.thinning import thinned_pixels, thinned_points
from doorstate.types import Points


def wall(seed: int, count: int) -> Points:
    points = np.random.default_rng(seed).uniform(-2, 2, (count, 3))
    points[:, 0] = 3
    return points.astype(np.float32)


def test_pixels_of_every_second_row_and_column() -> None:
    rows, columns = np.divmod(thinned_pixels(48, 64, 700), 64)
    assert sorted(set(rows)) == list(range(0, 48, 2))
    assert sorted(set(columns)) == list(range(0, 64, 2))
    assert len(thinned_pixels(48, 64, 768)) == 768
    assert len(thinned_pixels(48, 64, 769)) == 48 * 64
    np.testing.assert_array_equal(thinned_pixels(4, 4, 40), np.arange(16))


@given(seed=st.integers(0, 2**32 - 1), fewest=st.sampled_from([100, 800, 3200]), flat=st.booleans())
@settings(max_examples=40)
def test_enough_points_stay_and_each_dropped_one_has_a_neighbour(seed: int, fewest: int, flat: bool) -> None:
    points = (
        wall(seed, 20_000)
        if flat
        else np.random.default_rng(seed).normal(size=(20_000, 3)).astype(np.float32)
    )
    rows = thinned_points(points, fewest)
    assert fewest <= len(rows) <= 2.2 * fewest
    assert (np.diff(rows) > 0).all()
    cells_along_a_side = (fewest / 2) ** (1 / 2 if flat else 1 / 3)
    assert (
        cKDTree(points[rows]).query(points)[0].max() < 4 * np.ptp(points, axis=0).max() / cells_along_a_side
    )


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_the_order_of_points_does_not_matter(seed: int) -> None:
    points = wall(seed, 5000)
    shuffle = np.random.default_rng(seed).permutation(len(points))
    np.testing.assert_array_equal(
        np.sort(shuffle[thinned_points(points[shuffle], 100)]), thinned_points(points, 100)
    )


@pytest.mark.parametrize("scale", [1e-40, 1e-6, 1.0, 1e6])
def test_any_size_of_cloud_is_thinned(scale: float) -> None:
    points = (wall(3, 4000) * np.float32(scale)).astype(np.float32)
    assert len(thinned_points(points, 100)) < 2000


def test_one_point_far_away_leaves_enough_of_the_others() -> None:
    points = wall(5, 30_000)
    points[7] = 1000
    rows = thinned_points(points, 4000)
    assert 7 in rows
    assert 4000 <= len(rows) < 2.2 * 4000


def test_repeated_points_stay_once_with_their_lowest_row() -> None:
    points = np.tile(wall(4, 1000), (5, 1))
    rows = thinned_points(points, 1000)
    np.testing.assert_array_equal(rows, np.arange(1000))


@pytest.mark.parametrize("count", [1, 799, 800])
def test_a_small_cloud_keeps_all_points(count: int) -> None:
    np.testing.assert_array_equal(thinned_points(wall(0, count), 800), np.arange(count))


def test_a_cloud_with_few_distinct_points_keeps_all() -> None:
    np.testing.assert_array_equal(thinned_points(np.ones((2000, 3), np.float32), 100), np.arange(2000))
    np.testing.assert_array_equal(thinned_points(np.tile(wall(0, 99), (20, 1)), 100), np.arange(1980))
