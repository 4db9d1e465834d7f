# SPDX-License-Identifier: Apache-2.0
"""Neighbourhood operations against loops, scikit-learn and hand-worked cases."""

from __future__ import annotations

import plain
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.neighbors import NearestNeighbors

from doorstate.networks.ops import ball_query, gather_rows, knn, max_over, reduce_neighbours

# On a line, so that every distance is exact; farthest-point order does not matter here.
LINE = torch.tensor([[[x, 0.0, 0.0] for x in (0.0, 0.125, 0.375, 0.0625, 0.25)]])


def cloud(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


def test_gather_rows_picks_rows_of_the_same_cloud() -> None:
    values = cloud(3, 7, 4)
    indices = torch.randint(0, 7, (3, 5, 2), generator=torch.Generator().manual_seed(1))
    assert torch.equal(gather_rows(values, indices), plain.gather(values, indices))


@pytest.mark.parametrize("reduction", ["sum", "max"])
def test_reduced_neighbours_equal_gathered_ones(reduction: str) -> None:
    indices = torch.randint(0, 9, (2, 6, 4), generator=torch.Generator().manual_seed(1))
    fast_values, plain_values = (cloud(2, 9, 5).double().requires_grad_() for _ in range(2))
    fast = reduce_neighbours(fast_values, indices, "sum" if reduction == "sum" else "max")
    gathered = plain.gather(plain_values, indices)
    expected = gathered.sum(2) if reduction == "sum" else gathered.max(2).values
    torch.testing.assert_close(fast, expected, rtol=0, atol=1e-12)
    fast.square().sum().backward()
    expected.square().sum().backward()
    torch.testing.assert_close(fast_values.grad, plain_values.grad, rtol=0, atol=1e-12)


def test_max_over_is_the_same_with_and_without_gradient() -> None:
    values = cloud(2, 5, 3)
    assert torch.equal(max_over(values, 1), max_over(values.clone().requires_grad_(), 1))


def test_knn_agrees_with_scikit_learn() -> None:
    points = cloud(2, 150, 3)
    found = knn(points[:, :40], points, 9)
    for b in range(2):
        tree = NearestNeighbors(n_neighbors=9).fit(points[b].numpy())
        assert (found[b].numpy() == tree.kneighbors(points[b, :40].numpy(), return_distance=False)).all()


@pytest.mark.parametrize("dimensions", [3, 8])
def test_knn_equals_its_plain_twin(dimensions: int) -> None:
    points = cloud(2, 20, dimensions).double()
    assert torch.equal(knn(points[:, :7], points, 6), plain.knn(points[:, :7], points, 6))


def test_knn_of_more_queries_than_one_block() -> None:
    points = cloud(1, 1500, 3)
    squared = (points.unsqueeze(2) - points.unsqueeze(1)).square().sum(-1)
    found = knn(points, points, 4)
    torch.testing.assert_close(
        squared.gather(2, found), squared.topk(4, largest=False).values, rtol=0, atol=1e-7
    )
    assert (found[0, :, 0] == torch.arange(1500)).all()


@pytest.mark.parametrize("dimensions", [3, 16])
def test_a_query_comes_first_whatever_duplicates_it_has(dimensions: int) -> None:
    points = cloud(2, 6, dimensions).repeat(1, 5, 1)  # every point five times
    found = knn(points, points, 5)
    assert (found[..., 0] == torch.arange(30)).all()
    assert (found % 6 == (torch.arange(30) % 6).view(1, -1, 1)).all()


def test_a_foreign_query_is_not_taken_for_the_point_of_its_index() -> None:
    points = torch.tensor([[[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]])
    query = torch.tensor([[[1.9, 0, 0]]])
    assert knn(query, points, 3).tolist() == [[[2, 1, 0]]]


def test_knn_returns_all_points_if_there_are_fewer_than_k() -> None:
    points = cloud(1, 5, 3)
    assert knn(points, points, 20).shape == (1, 5, 5)


@pytest.mark.parametrize("far_m", [0.0, 100.0])
def test_neighbours_in_feature_space_survive_a_large_offset(far_m: float) -> None:
    points = cloud(1, 64, 16)
    assert torch.equal(knn(points + far_m, points + far_m, 2), knn(points, points, 2))


def test_neighbours_do_not_depend_on_autocast() -> None:
    points, features = cloud(1, 300, 3), cloud(1, 300, 16)
    near, ball, alike = knn(points, points, 8), ball_query(points, points, 0.5, 8), knn(features, features, 8)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        assert torch.equal(knn(points, points, 8), near)
        assert torch.equal(ball_query(points, points, 0.5, 8), ball)
        assert torch.equal(knn(features, features, 8), alike)


@pytest.mark.parametrize(
    ("radius", "num_samples", "expected"),
    [
        (0.25, 4, [0, 1, 3, 0]),  # the point at exactly the radius is outside
        (0.25, 2, [0, 1]),  # first in index order, not the nearest, 0 and 3
        (1e-6, 3, [0, 0, 0]),
        (9.0, 7, [0, 1, 2, 3, 4, 0, 0]),  # more slots than points
    ],
)
def test_ball_query_by_hand(radius: float, num_samples: int, expected: list[int]) -> None:
    assert ball_query(LINE[:, :1], LINE, radius, num_samples).tolist() == [[expected]]


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10**6), st.sampled_from([0.1, 0.5, 1.0, 3.0]), st.integers(1, 12))
def test_ball_query_equals_its_plain_twin(seed: int, radius: float, num_samples: int) -> None:
    points = (
        cloud(2, 10, 3, seed=seed) * 4
    ).round().double() / 4  # a grid: duplicates and distances at the edge
    centres = points[:, :4]
    expected = plain.ball_query(centres, points, radius, num_samples)
    assert torch.equal(ball_query(centres, points, radius, num_samples), expected)


def test_a_centre_is_at_zero_offset_in_its_own_ball() -> None:
    points = cloud(2, 50, 3)
    indices = ball_query(points[:, :8], points, 0.8, 50)
    offsets = gather_rows(points, indices) - points[:, :8].unsqueeze(2)
    own = indices == torch.arange(8).view(1, 8, 1)
    assert own.any(-1).all()
    assert (offsets[own] == 0).all()
