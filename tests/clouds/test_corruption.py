# SPDX-License-Identifier: Apache-2.0
"""Losses against their plain form cloud by cloud, their sizes, the order of what is left, and replay."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from pydantic import ValidationError
from scipy.spatial.distance import cdist

from doorstate.clouds.corruption import (
    LEAST_KEPT,
    Corruption,
    CorruptionDraw,
    draw_corruption,
    first_kept,
    kept_points,
)
from doorstate.clouds.sampling import farthest_point_indices
from doorstate.types import Points

SCALE_M = 1.5
CLOUDS, STORED = 5, 240


def room(seed: int, count: int = STORED) -> Points:
    """Return a wall, a floor and a box before them in farthest-point order, in units of 1.5 m."""
    rng = np.random.default_rng(seed)
    u, v = rng.uniform(-1.5, 1.5, (2, 20 * count))
    surface = rng.integers(0, 3, 20 * count)
    wall = np.stack([u, np.zeros_like(u), v], axis=1)
    floor = np.stack([u, v, np.full_like(u, -1.5)], axis=1)
    front = np.stack([u / 4, np.full_like(u, 0.8), v / 4], axis=1)
    points = (np.choose(surface[:, None], [wall, floor, front]) / SCALE_M).astype(np.float32)
    return points[farthest_point_indices(points, count)]


POINTS = np.stack([room(seed) for seed in range(CLOUDS)])

corruptions = st.builds(
    Corruption,
    cut_outs=st.integers(0, 3),
    cut_sides_m=st.tuples(st.floats(0.1, 0.5), st.floats(0.5, 1.5)),
    holes=st.floats(0, 0.6),
    hole_size_m=st.floats(0.05, 1),
    thinning=st.floats(0, 0.9),
    mix=st.floats(0, 1),
)
seeds = st.integers(0, 2**32 - 1)


def drawn(corruption: Corruption, seed: int = 0, clouds: int = CLOUDS) -> CorruptionDraw:
    return draw_corruption(corruption, np.random.default_rng(seed), clouds, SCALE_M)


def plain_kept(cloud: Points, draw: CorruptionDraw, row: int) -> list[bool]:
    """Return what is left of one cloud, point by point."""
    size = len(cloud)

    def point_at(place: float) -> Points:
        return cloud[min(int(np.float32(place) * size), size - 1)]

    lost = [False] * size
    for place, sides in zip(draw.cut_places[row], draw.cut_sides[row], strict=True):
        for index, point in enumerate(cloud):
            lost[index] |= all(2 * abs(point - point_at(place)) < sides)
    field = np.cos(cloud @ draw.hole_waves[row].T + draw.hole_phases[row]).sum(axis=1)
    for index in np.argsort(-field)[: math.floor(draw.hole_shares[row] * size)]:
        lost[index] = True
    middle, region = point_at(draw.thin_places[row]), []
    for index, point in enumerate(cloud):
        if math.isinf(draw.thin_radii[row]):
            inside = float((point - middle) @ draw.thin_directions[row]) >= 0
        else:
            inside = float(((point - middle) ** 2).sum()) <= draw.thin_radii[row] ** 2
        region += [index] if inside else []
    for index in region[math.ceil((1 - draw.thin_shares[row]) * len(region)) :]:
        lost[index] = True
    if sum(lost) > (1 - LEAST_KEPT) * size:
        return [True] * size
    return [not gone for gone in lost]


@given(corruption=corruptions, seed=seeds)
@settings(max_examples=25)
def test_a_batch_loses_what_its_clouds_lose_one_by_one(corruption: Corruption, seed: int) -> None:
    draw = drawn(corruption, seed)
    kept = kept_points(POINTS, draw)
    expected = np.array([plain_kept(cloud, draw, row) for row, cloud in enumerate(POINTS)])
    # A product of matrices rounds differently for a batch: a point on the edge of a loss may go either way.
    assert (kept != expected).sum() <= 2
    assert kept.mean(axis=1).min() >= LEAST_KEPT


@given(corruption=corruptions, seed=seeds)
@settings(max_examples=20)
def test_a_seed_draws_the_same_again(corruption: Corruption, seed: int) -> None:
    for one, other in zip(drawn(corruption, seed), drawn(corruption, seed), strict=True):
        np.testing.assert_array_equal(one, other)


@given(
    kept=st.lists(st.booleans(), min_size=1, max_size=40).filter(any),
    count=st.integers(1, 60),
)
def test_points_left_keep_their_order_and_are_repeated_in_it(kept: list[bool], count: int) -> None:
    (taken,) = first_kept(np.array([kept]), count)
    left = [index for index, is_kept in enumerate(kept) if is_kept]
    assert taken.tolist() == (left * count)[:count]


def test_defaults_change_nothing() -> None:
    assert Corruption().changes_nothing
    assert Corruption(cut_sides_m=(0.1, 0.2), hole_size_m=1.0).changes_nothing
    draw = drawn(Corruption())
    assert kept_points(POINTS, draw).all()
    assert np.isnan(draw.donors).all()
    for change in ({"cut_outs": 1}, {"holes": 0.1}, {"thinning": 0.1}, {"mix": 0.1}):
        assert not Corruption.model_validate(change).changes_nothing


def test_cut_outs_are_boxes_of_their_size() -> None:
    corruption = Corruption(cut_outs=2, cut_sides_m=(0.3, 0.6))
    draw = drawn(corruption, clouds=2000)
    used = draw.cut_sides[..., 0] > 0
    assert np.bincount(used.sum(axis=1)) == pytest.approx([2000 / 3] * 3, rel=0.1)
    sides_m = draw.cut_sides[used] * SCALE_M
    assert 0.3 - 1e-6 <= sides_m.min() <= 0.31
    assert 0.59 <= sides_m.max() <= 0.6 + 1e-6
    draw = drawn(Corruption(cut_outs=1, cut_sides_m=(1.0, 1.0)), seed=1)
    for cloud, kept, place, sides in zip(
        POINTS, kept_points(POINTS, draw), draw.cut_places[:, 0], draw.cut_sides[:, 0], strict=True
    ):
        lost = cloud[~kept]
        assert len(lost) == 0 or (np.ptp(lost, axis=0) <= sides + 1e-6).all()
        assert kept[int(place * STORED)] == (sides[0] == 0)


def test_holes_have_their_share_and_are_clusters() -> None:
    corruption = Corruption(holes=0.4, hole_size_m=0.4)
    draw = drawn(corruption)
    kept = kept_points(POINTS, draw)
    np.testing.assert_array_equal((~kept).sum(axis=1), np.floor(draw.hole_shares * STORED))
    assert drawn(corruption, clouds=4000).hole_shares.mean() == pytest.approx(0.2, abs=0.01)
    # The nearest point of a lost one is lost too far more often than by chance.
    together = []
    for cloud, left in zip(POINTS, kept, strict=True):
        distances = cdist(cloud, cloud) + np.diag([np.inf] * STORED)
        together.append((~left)[distances.argmin(axis=1)][~left].mean() / (~left).mean())
    assert np.mean(together) > 2


def test_thinning_takes_the_last_points_of_a_half_space_or_a_ball() -> None:
    draw = drawn(Corruption(thinning=0.8), seed=3, clouds=400)
    assert np.isinf(draw.thin_radii).mean() == pytest.approx(0.5, abs=0.1)
    assert draw.thin_shares.max() <= 0.8
    np.testing.assert_allclose(np.linalg.norm(draw.thin_directions, axis=1), 1, atol=1e-6)
    for row in range(CLOUDS):
        part = CorruptionDraw(*(values[row : row + 1] for values in draw))
        (kept,) = kept_points(POINTS[row : row + 1], part)
        lost = np.flatnonzero(~kept)
        middle = POINTS[row, int(part.thin_places[0] * STORED)]
        if np.isfinite(part.thin_radii[0]) and len(lost):
            assert np.linalg.norm(POINTS[row, lost] - middle, axis=1).max() <= part.thin_radii[0] + 1e-6


def covering_radius(cloud: Points, prefix: Points) -> float:
    distances: NDArray[np.float64] = cdist(cloud, prefix)
    return float(distances.min(axis=1).max())


@pytest.mark.parametrize("seed", range(4))
def test_prefixes_of_what_is_left_cover_it_nearly_as_its_own_samples_do(seed: int) -> None:
    """The same bound holds for the distances between points of a prefix, since the order is kept."""
    draw = drawn(Corruption(cut_outs=2, holes=0.3, thinning=0.5), seed)
    for cloud, kept in zip(POINTS, kept_points(POINTS, draw), strict=True):
        left = cloud[kept]
        for size in (16, 32, 64):
            own = left[farthest_point_indices(left, size)]
            assert covering_radius(left, left[:size]) <= 2 * covering_radius(left, own)


@pytest.mark.parametrize(
    "wrong",
    [
        {"cut_outs": -1},
        {"holes": 1.0},
        {"cut_sides_m": (0.4, 0.1)},
        {"hole_size_m": 0},
        {"mix": 1.1},
        {"cut": 1},
    ],
)
def test_impossible_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValidationError):
        Corruption.model_validate(wrong)
