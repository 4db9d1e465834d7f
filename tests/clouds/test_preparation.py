# SPDX-License-Identifier: Apache-2.0
"""From raw points to a network's input: what is dropped, what is kept, what is refused and why."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.clouds.preparation import (
    MIN_POINTS,
    CloudSpec,
    check_one_cloud,
    is_image,
    normalize,
    prepare_cloud,
)
from doorstate.clouds.sampling import farthest_point_indices
from doorstate.errors import CloudContentError
from doorstate.types import Points
from tests.hand_made_clouds import image_of_a_rough_wall

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
@settings(deadline=None, max_examples=30)
def test_what_was_not_measured_is_dropped_and_indices_point_to_raw_rows(
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


def test_organized_clouds_are_taken_row_by_row() -> None:
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
    ("raw", "message"),
    [
        (np.zeros((0, 3)), "the cloud is empty: it holds no points"),
        (np.full((500, 3), NAN), "nothing was measured: all points are NaN or infinite"),
        (np.full((500, 3), INF), "nothing was measured: all points are NaN or infinite"),
        (np.zeros((500, 3)), "all measured points lie at the origin: the cloud holds no surface"),
        (cloud(MIN_POINTS - 1), "too few points: 127 measured, at least 128 are needed"),
        (np.ones((500, 3)), "too few points: 1 distinct of 500 measured, at least 128 are needed"),
        (
            cloud(500) * 1000,
            "half of the points are more than .* m away: 1000 times too far .* say --units mm .*",
        ),
        (
            cloud(500) * 100,
            "half of the points are more than .* m away: 100 times too far .* say --units cm .*",
        ),
        (
            cloud(500) * 15000,
            "half of the points are more than .* m away: in which unit is it[?] say --units .*",
        ),
        (
            cloud(500) / 1000,
            "half of the points are within .* mm of the camera: 1000 times too near .* say --units km .*",
        ),
    ],
)
def test_a_cloud_that_cannot_be_used_is_refused_in_one_line(raw: Points, message: str) -> None:
    with pytest.raises(CloudContentError, match=f"^{message}$"):
        prepare_cloud(raw, CloudSpec(num_points=200))


def test_fewer_points_than_the_least_are_kept_where_so_few_are_asked_for() -> None:
    assert prepare_cloud(cloud(500), CloudSpec(num_points=16)).points.shape == (16, 3)


def test_zeros_for_what_did_not_return_are_no_reason_to_doubt_the_units() -> None:
    raw = np.concatenate([np.zeros((2000, 3), np.float32), cloud(500)])
    assert prepare_cloud(raw, CloudSpec(num_points=200)).indices.min() >= 2000


@given(seed=st.integers(0, 2**32 - 1), offset=st.floats(-20, 20))
@settings(deadline=None, max_examples=30)
def test_normalized_clouds_are_centred_and_in_units_of_three_metres(seed: int, offset: float) -> None:
    points = cloud(200, seed) + np.float32(offset)
    batch = np.stack([points, points * 2])
    found = normalize(batch)
    assert found.dtype == np.float32
    assert np.abs(found.mean(axis=1, dtype=np.float64)).max() < 1e-6
    np.testing.assert_allclose(found[0] * 3, points - points.mean(axis=0, dtype=np.float64), atol=1e-5)
    np.testing.assert_array_equal(found[1], normalize(points * 2))


def test_thinning_names_the_pixels_of_the_whole_cloud() -> None:
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


def test_what_lies_too_far_ahead_is_left_out_whole_or_thinned() -> None:
    cloud = np.random.default_rng(4).uniform(0.5, 9, (60, 80, 3)).astype(np.float32)
    for thin in (False, True):
        prepared = prepare_cloud(cloud, CloudSpec(num_points=200, thin=thin, max_depth_m=5.0))
        assert len(prepared.points) == 200
        assert prepared.points[:, 0].max() <= 5
        assert np.array_equal(cloud.reshape(-1, 3)[prepared.indices], prepared.points)
        near = np.where(cloud[..., :1] <= 5, cloud, np.nan)
        assert np.array_equal(
            prepare_cloud(near, CloudSpec(num_points=200, thin=thin)).points, prepared.points
        )


def test_nothing_within_reach_is_told() -> None:
    cloud = np.full((400, 3), 7.0, np.float32) + np.random.default_rng(0).normal(0, 0.1, (400, 3)).astype(
        np.float32
    )
    with pytest.raises(CloudContentError, match="too few points: 0 within 5 m"):
        prepare_cloud(cloud, CloudSpec(num_points=200, max_depth_m=5.0))


def test_an_image_is_told_from_several_clouds() -> None:
    image = image_of_a_rough_wall(60, 80)
    assert check_one_cloud(image) is image
    assert check_one_cloud(image[:1]).shape == (80, 3), "one row is a list of points"
    holed = np.where(np.random.default_rng(0).random((60, 80, 1)) < 0.6, np.float32(np.nan), image)
    assert is_image(holed)
    assert is_image(np.full((60, 80, 3), np.nan)), "nothing to tell it by"
    scan = np.stack([farthest_first(image.reshape(-1, 3), seed) for seed in range(4)])
    with pytest.raises(CloudContentError, match=r"\(4, 512, 3\) is no image: .* cloud\[0\]"):
        check_one_cloud(scan)


@pytest.mark.parametrize("kept", [slice(None), slice(None, None, 7), slice(100, 3000)])
def test_frames_in_the_order_of_their_pixels_are_no_image_either(kept: slice) -> None:
    flat = image_of_a_rough_wall(60, 80).reshape(-1, 3)[kept]
    for count in (2, 3, 8):
        assert not is_image(np.stack([flat] * count))


def farthest_first(points: Points, seed: int) -> Points:
    shuffled = np.random.default_rng(seed).permutation(points)
    return prepare_cloud(shuffled, CloudSpec(num_points=512)).points


def test_what_is_too_far_away_is_said_with_how_far() -> None:
    far = cloud(500) + np.array([20, 0, 0], np.float32)
    with pytest.raises(
        CloudContentError, match=r"0 within 5 m ahead, .* half of all are more than 2.* m away"
    ):
        prepare_cloud(far, CloudSpec(num_points=200, max_depth_m=5))
