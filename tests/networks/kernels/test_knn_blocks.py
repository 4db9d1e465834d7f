# SPDX-License-Identifier: Apache-2.0
"""Nearest neighbours between blocks of points, against all distances."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.networks.kernels.knn import knn
from tests.networks.twins import random_rows


def by_distance_and_index(points: torch.Tensor, k: int) -> torch.Tensor:
    """Neighbours by float64 distances, themselves first, then ties by index."""
    points = points.double()
    squared = (points.unsqueeze(2) - points.unsqueeze(1)).square().sum(-1)
    squared.diagonal(dim1=1, dim2=2).fill_(-1)
    return squared.argsort(dim=-1, stable=True)[..., :k]


# A grid of eighths: squared distances are exact in float32, and nearly all of them are ties.
@pytest.mark.parametrize(("dimensions", "k"), [(3, 8), (3, 40), (6, 20), (64, 20)])
@pytest.mark.parametrize("in_order", [False, True])
def test_neighbours_in_blocks_are_those_of_all_distances(dimensions: int, k: int, in_order: bool) -> None:
    points = (random_rows(2, 1024, dimensions) * 8).round() / 8
    points -= points.mean(1, keepdim=True).mul(2**16).round() / 2**16
    neighbours = knn(points, points, k, in_order=in_order)
    expected = by_distance_and_index(points, k)
    squared = (points.double().unsqueeze(2) - points.double().unsqueeze(1)).square().sum(-1)
    torch.testing.assert_close(squared.gather(2, neighbours), squared.gather(2, expected), rtol=0, atol=1e-4)
    assert (neighbours[..., 0] == torch.arange(1024)).all()
    assert all(len(set(row.tolist())) == k for row in neighbours.flatten(0, 1)[::37])


@settings(max_examples=20)
@given(st.integers(0, 10**6), st.sampled_from([1024, 1152, 1536]), st.floats(0.01, 100), st.floats(-50, 50))
def test_neighbours_in_blocks_of_surfaces(seed: int, count: int, size: float, shift: float) -> None:
    points = random_rows(1, count, 3, seed=seed)
    points[..., 0] = (points[..., 1] * 2).sin()  # thin, as clouds of rooms are
    points = points * size + shift
    neighbours = knn(points, points, 16)
    squared = (points.double().unsqueeze(2) - points.double().unsqueeze(1)).square().sum(-1)
    expected = squared.topk(16, largest=False).values
    rounding = 4e-6 * (size + abs(shift)) * size  # of float32 coordinates
    torch.testing.assert_close(squared.gather(2, neighbours), expected, rtol=1e-5, atol=rounding)


def test_duplicates_in_blocks_come_by_index_after_the_query_itself() -> None:
    points = random_rows(1, 256, 3).repeat(1, 4, 1)  # every point four times
    neighbours = knn(points, points, 4)
    own = torch.arange(1024).view(-1, 1)
    others = torch.stack([torch.arange(256) + 256 * i for i in range(4)], 1).repeat(4, 1)
    others = others[others != own].view(1024, 3)
    assert torch.equal(neighbours[0], torch.cat([own, others], dim=1))
