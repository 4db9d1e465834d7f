# SPDX-License-Identifier: Apache-2.0
"""Preparation of raw clouds: dropped points, kept points, refused clouds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.clouds.preparation import MIN_POINTS, CloudSpec, prepare_cloud
from doorstate.clouds.samplers import NUMPY
from doorstate.clouds.sampling import farthest_point_indices
from doorstate.errors import CloudContentError, TooFewPointsError
from doorstate.types import Points

NAN, INF = np.nan, np.inf


def cloud(count: int, seed: int = 0) -> Points:
    return np.random.default_rng(seed).uniform(0.5, 4.0, (count, 3)).astype(np.float32)


NOT_MEASURED = (
    (NAN, NAN, NAN),
    (NAN, 1.0, 1.0),
    (1.0, -INF, 1.0),
    (INF, INF, INF),
    (0.0, 0.0, 0.0),
    (1.0, 1.0, 3.4e38),
)


@given(seed=st.integers(0, 2**32 - 1), holes=st.lists(st.sampled_from(NOT_MEASURED), max_size=900))
@settings(max_examples=30)
def test_unmeasured_points_are_dropped_and_indices_are_raw_rows(
    seed: int, holes: list[tuple[float, float, float]]
) -> None:
    raw = cloud(400, seed)
    raw = (
        np.insert(raw, np.random.default_rng(seed).integers(0, 401, len(holes)), holes, axis=0)
        if holes
        else raw
    )
    points, indices = prepare_cloud(raw, CloudSpec(num_points=200))
    assert points.dtype == np.float32
    np.testing.assert_array_equal(points, raw[indices])
    np.testing.assert_array_equal(points, cloud(400, seed)[farthest_point_indices(cloud(400, seed), 200)])


def test_organized_clouds_are_flattened_row_by_row() -> None:
    raw = cloud(600).reshape(20, 30, 3)
    raw[3, 4] = NAN
    points, indices = prepare_cloud(raw, CloudSpec(num_points=300))
    np.testing.assert_array_equal(points, raw.reshape(-1, 3)[indices])
    assert 3 * 30 + 4 not in indices


def test_a_small_cloud_gives_all_its_points_once() -> None:
    points, indices = prepare_cloud(cloud(150), CloudSpec(num_points=4096))
    assert sorted(indices) == list(range(150))
    assert points.shape == (150, 3)


def test_repeated_points_are_taken_once() -> None:
    raw = np.tile(cloud(300), (3, 1))
    for count in (299, 300, 500):
        points, indices = prepare_cloud(raw, CloudSpec(num_points=count))
        assert len(indices) == len(np.unique(points, axis=0)) == min(count, 300)


@pytest.mark.parametrize(
    ("raw", "reason"),
    [
        (np.zeros((0, 3)), "empty"),
        (np.full((500, 3), NAN), "NaN or infinite"),
        (np.full((500, 3), INF), "NaN or infinite"),
        (np.zeros((500, 3)), "origin"),
        (cloud(MIN_POINTS - 1), "127 measured"),
        (np.ones((500, 3)), "1 distinct of 500 measured"),
    ],
)
def test_too_few_points_are_refused(raw: Points, reason: str) -> None:
    with pytest.raises(TooFewPointsError, match=reason):
        prepare_cloud(raw, CloudSpec(num_points=200))


def test_impossible_units_are_refused() -> None:
    with pytest.raises(CloudContentError) as caught:
        prepare_cloud(cloud(500) * 1000, CloudSpec(num_points=200))
    assert caught.value.suggestions == {"units_m": 0.001}


def test_a_spec_may_have_fewer_points_than_a_network_needs() -> None:
    assert prepare_cloud(cloud(500), CloudSpec(num_points=16)).points.shape == (16, 3)


def test_unmeasured_zeros_do_not_count_for_the_units() -> None:
    raw = np.concatenate([np.zeros((2000, 3), np.float32), cloud(500)])
    assert prepare_cloud(raw, CloudSpec(num_points=200)).indices.min() >= 2000


def test_indices_of_thinned_clouds_are_pixels_of_the_whole_cloud() -> None:
    rng = np.random.default_rng(0)
    image = rng.uniform(1, 3, (96, 128, 3)).astype(np.float32)
    image[::3, ::5] = np.nan
    points, indices = prepare_cloud(image, CloudSpec(num_points=140, thin=True))
    np.testing.assert_array_equal(image.reshape(-1, 3)[indices], points)
    rows, columns = np.divmod(indices, 128)
    step = 2  # 48 x 64 = 3072 pixels; every third row and column would leave fewer than 16 x 140
    assert set(rows % step) == set(columns % step) == {0}
    few = prepare_cloud(image[:16, :16], CloudSpec(num_points=140, thin=True))
    np.testing.assert_array_equal(
        few.points, prepare_cloud(image[:16, :16], CloudSpec(num_points=140)).points
    )


def test_points_too_far_ahead_are_dropped() -> None:
    cloud = np.random.default_rng(4).uniform(0.5, 9, (60, 80, 3)).astype(np.float32)
    for thin in (False, True):
        prepared = prepare_cloud(
            cloud, CloudSpec(num_points=200, thin=thin, max_depth_m=5.0, remove_outliers=False)
        )
        assert len(prepared.points) == 200
        assert prepared.points[:, 0].max() <= 5
        assert np.array_equal(cloud.reshape(-1, 3)[prepared.indices], prepared.points)
        near = np.where(cloud[..., :1] <= 5, cloud, np.nan)
        assert np.array_equal(
            prepare_cloud(near, CloudSpec(num_points=200, thin=thin, remove_outliers=False)).points,
            prepared.points,
        )


def test_clouds_beyond_the_depth_limit_are_refused() -> None:
    cloud = np.full((400, 3), 7.0, np.float32) + np.random.default_rng(0).normal(0, 0.1, (400, 3)).astype(
        np.float32
    )
    with pytest.raises(CloudContentError, match="0 within 5 m"):
        prepare_cloud(cloud, CloudSpec(num_points=200, max_depth_m=5.0))


def test_the_error_of_a_far_cloud_has_its_distance() -> None:
    far = cloud(500) + np.array([20, 0, 0], np.float32)
    with pytest.raises(CloudContentError, match=r"0 within 5 m ahead, .* 2\d\.\d m away"):
        prepare_cloud(far, CloudSpec(num_points=200, max_depth_m=5))


def test_flat_clouds_are_thinned_too() -> None:
    flat = cloud(20_000)
    flat[::7] = NAN
    points, indices = prepare_cloud(flat, CloudSpec(num_points=200, thin=True))
    np.testing.assert_array_equal(points, flat[indices])
    few = prepare_cloud(flat[:1800], CloudSpec(num_points=200, thin=True))
    np.testing.assert_array_equal(few.points, prepare_cloud(flat[:1800], CloudSpec(num_points=200)).points)
    whole = prepare_cloud(flat, CloudSpec(num_points=200))
    assert len(np.intersect1d(indices, whole.indices)) < 200


def test_a_sampler_may_be_given() -> None:
    points = prepare_cloud(cloud(500), CloudSpec(num_points=200), NUMPY).points
    np.testing.assert_array_equal(points, prepare_cloud(cloud(500), CloudSpec(num_points=200)).points)
