# SPDX-License-Identifier: Apache-2.0
"""Neighbour searches against loops, scikit-learn and hand-worked cases."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.neighbors import NearestNeighbors

from doorstate.networks.kernels.ops import gather_rows
from doorstate.networks.kernels.search import ball_query, knn, spatial_order
from tests.networks import plain

# On a line, so that every distance is exact; farthest-point order does not matter here.
LINE = torch.tensor([[[x, 0.0, 0.0] for x in (0.0, 0.125, 0.375, 0.0625, 0.25)]])


def cloud(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


def by_distance_and_index(points: torch.Tensor, k: int) -> torch.Tensor:
    """Neighbours by float64 distances, themselves first, then ties by index."""
    points = points.double()
    squared = (points.unsqueeze(2) - points.unsqueeze(1)).square().sum(-1)
    squared.diagonal(dim1=1, dim2=2).fill_(-1)
    return squared.argsort(dim=-1, stable=True)[..., :k]


def test_spatial_order_is_a_permutation_of_near_runs() -> None:
    points = cloud(2, 1024, 3)
    order = spatial_order(points)
    assert torch.equal(order.sort(1).values, torch.arange(1024).expand(2, -1))
    runs = gather_rows(points, order).view(2, 32, 32, 3)
    assert runs.var(2).sum(-1).mean() < 0.3 * points.var(1).sum(-1).mean()


@pytest.mark.parametrize("count", [1, 7, 96, 100, 1000])
def test_spatial_order_of_any_number_of_points(count: int) -> None:
    order = spatial_order(cloud(1, count, 3))
    assert torch.equal(order.sort(1).values, torch.arange(count).view(1, -1))


# A grid of eighths: squared distances are exact in float32, and nearly all of them are ties.
@pytest.mark.parametrize(("dimensions", "k"), [(3, 8), (3, 40), (6, 20), (64, 20)])
@pytest.mark.parametrize("in_order", [False, True])
def test_neighbours_in_blocks_are_those_of_all_distances(dimensions: int, k: int, in_order: bool) -> None:
    points = (cloud(2, 1024, dimensions) * 8).round() / 8
    points -= points.mean(1, keepdim=True).mul(2**16).round() / 2**16
    found = knn(points, points, k, in_order=in_order)
    expected = by_distance_and_index(points, k)
    squared = (points.double().unsqueeze(2) - points.double().unsqueeze(1)).square().sum(-1)
    torch.testing.assert_close(squared.gather(2, found), squared.gather(2, expected), rtol=0, atol=1e-4)
    assert (found[..., 0] == torch.arange(1024)).all()
    assert all(len(set(row.tolist())) == k for row in found.flatten(0, 1)[::37])


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10**6), st.sampled_from([1024, 1152, 1536]), st.floats(0.01, 100), st.floats(-50, 50))
def test_neighbours_in_blocks_of_surfaces(seed: int, count: int, size: float, shift: float) -> None:
    points = cloud(1, count, 3, seed=seed)
    points[..., 0] = (points[..., 1] * 2).sin()  # thin, as clouds of rooms are
    points = points * size + shift
    found = knn(points, points, 16)
    squared = (points.double().unsqueeze(2) - points.double().unsqueeze(1)).square().sum(-1)
    expected = squared.topk(16, largest=False).values
    rounding = 4e-6 * (size + abs(shift)) * size  # of float32 coordinates
    torch.testing.assert_close(squared.gather(2, found), expected, rtol=1e-5, atol=rounding)


def test_duplicates_in_blocks_come_by_index_after_the_query_itself() -> None:
    points = cloud(1, 256, 3).repeat(1, 4, 1)  # every point four times
    found = knn(points, points, 4)
    own = torch.arange(1024).view(-1, 1)
    others = torch.stack([torch.arange(256) + 256 * i for i in range(4)], 1).repeat(4, 1)
    others = others[others != own].view(1024, 3)
    assert torch.equal(found[0], torch.cat([own, others], dim=1))


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


def test_knn_of_more_queries_than_points() -> None:
    points = cloud(3, 90, 3, seed=1)
    query = torch.cat([points, cloud(3, 400, 3, seed=2)], dim=1)
    found = knn(query, points, 4)
    for each in range(3):
        neighbours = NearestNeighbors(n_neighbors=4).fit(points[each].numpy())
        expected = neighbours.kneighbors(query[each].numpy(), return_distance=False)
        assert found[each].tolist() == expected.tolist()
