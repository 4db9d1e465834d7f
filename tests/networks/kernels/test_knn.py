# SPDX-License-Identifier: Apache-2.0
"""Nearest neighbours, against loops and scikit-learn."""

from __future__ import annotations

import pytest
import torch
from sklearn.neighbors import NearestNeighbors

from doorstate.networks.kernels.ball_query import ball_query
from doorstate.networks.kernels.knn import knn
from tests.networks import plain
from tests.networks.twins import random_rows


def test_knn_agrees_with_scikit_learn() -> None:
    points = random_rows(2, 150, 3)
    neighbours = knn(points[:, :40], points, 9)
    for b in range(2):
        tree = NearestNeighbors(n_neighbors=9).fit(points[b].numpy())
        assert (neighbours[b].numpy() == tree.kneighbors(points[b, :40].numpy(), return_distance=False)).all()


@pytest.mark.parametrize("dimensions", [3, 8])
def test_knn_equals_its_plain_twin(dimensions: int) -> None:
    points = random_rows(2, 20, dimensions).double()
    assert torch.equal(knn(points[:, :7], points, 6), plain.knn(points[:, :7], points, 6))


def test_knn_of_more_queries_than_one_block() -> None:
    points = random_rows(1, 1500, 3)
    squared = (points.unsqueeze(2) - points.unsqueeze(1)).square().sum(-1)
    neighbours = knn(points, points, 4)
    torch.testing.assert_close(
        squared.gather(2, neighbours), squared.topk(4, largest=False).values, rtol=0, atol=1e-7
    )
    assert (neighbours[0, :, 0] == torch.arange(1500)).all()


@pytest.mark.parametrize("dimensions", [3, 16])
def test_a_query_comes_first_whatever_duplicates_it_has(dimensions: int) -> None:
    points = random_rows(2, 6, dimensions).repeat(1, 5, 1)  # every point five times
    neighbours = knn(points, points, 5)
    assert (neighbours[..., 0] == torch.arange(30)).all()
    assert (neighbours % 6 == (torch.arange(30) % 6).view(1, -1, 1)).all()


def test_a_foreign_query_is_not_taken_for_the_point_of_its_index() -> None:
    points = torch.tensor([[[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]])
    query = torch.tensor([[[1.9, 0, 0]]])
    assert knn(query, points, 3).tolist() == [[[2, 1, 0]]]


def test_knn_returns_all_points_if_there_are_fewer_than_k() -> None:
    points = random_rows(1, 5, 3)
    assert knn(points, points, 20).shape == (1, 5, 5)


@pytest.mark.parametrize("far_m", [0.0, 100.0])
def test_neighbours_in_feature_space_survive_a_large_offset(far_m: float) -> None:
    points = random_rows(1, 64, 16)
    assert torch.equal(knn(points + far_m, points + far_m, 2), knn(points, points, 2))


def test_neighbours_do_not_depend_on_autocast() -> None:
    points, features = random_rows(1, 300, 3), random_rows(1, 300, 16)
    near, ball, alike = knn(points, points, 8), ball_query(points, points, 0.5, 8), knn(features, features, 8)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        assert torch.equal(knn(points, points, 8), near)
        assert torch.equal(ball_query(points, points, 0.5, 8), ball)
        assert torch.equal(knn(features, features, 8), alike)


def test_knn_of_more_queries_than_points() -> None:
    points = random_rows(3, 90, 3, seed=1)
    query = torch.cat([points, random_rows(3, 400, 3, seed=2)], dim=1)
    neighbours = knn(query, points, 4)
    for b in range(3):
        tree = NearestNeighbors(n_neighbors=4).fit(points[b].numpy())
        expected = tree.kneighbors(query[b].numpy(), return_distance=False)
        assert neighbours[b].tolist() == expected.tolist()
