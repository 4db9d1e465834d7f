# SPDX-License-Identifier: Apache-2.0
"""Operations on rows against the ordinary ones of torch: values and gradients, ties and duplicates."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor

from doorstate.networks.kernels.ops import (
    gather_rows,
    max_over_points,
    neighbour_max,
    neighbour_sum,
    weigh_neighbours,
)
from tests.networks import plain
from tests.networks.twins import assert_same, rows


def neighbours(batch: int, queries: int, points: int, k: int) -> Tensor:
    return torch.randint(0, points, (batch, queries, k), generator=torch.Generator().manual_seed(1))


def test_gather_rows_picks_rows_of_the_same_cloud() -> None:
    indices = neighbours(3, 5, 7, 2)
    assert_same(lambda x: gather_rows(x, indices), lambda x: plain.gather(x, indices), rows(3, 7, 4))


def test_neighbour_sum_is_the_sum_of_gathered_rows() -> None:
    indices = neighbours(2, 6, 9, 4)
    indices[0, :, 0] = 3  # some points are nobody's neighbour, one is everybody's
    indices[indices == 5] = 4
    assert_same(lambda x: neighbour_sum(x, indices), lambda x: plain.gather(x, indices).sum(2), rows(2, 9, 5))


@pytest.mark.parametrize("ties", [False, True])
def test_neighbour_max_is_the_maximum_of_gathered_rows(ties: bool) -> None:
    indices = neighbours(2, 6, 9, 4)
    values = rows(2, 9, 5)
    if ties:  # the first of equal neighbours gets the gradient, as of torch.max
        values = values.round()
    assert_same(lambda x: neighbour_max(x, indices), lambda x: plain.gather(x, indices).max(2).values, values)
    assert torch.equal(neighbour_max(values, indices), plain.gather(values, indices).amax(2))


@pytest.mark.parametrize("multiples", [1, 3])
def test_weighed_neighbours_are_a_sum_of_products(multiples: int) -> None:
    assert_same(
        weigh_neighbours,
        lambda x, weight: torch.einsum("bpkc,kcm->bpmc", x, weight),
        rows(2, 6, 4, 5),
        rows(4, 5, multiples, seed=1),
    )


@pytest.mark.parametrize("count", [1, 32, 127, 128, 300])
@pytest.mark.parametrize("ties", [False, True])
def test_max_over_points_is_the_maximum(count: int, ties: bool) -> None:
    values = rows(2, 3, count, 5).round() if ties else rows(2, 3, count, 5)
    assert_same(max_over_points, lambda x: x.max(-2).values, values)
    assert torch.equal(max_over_points(values), values.amax(-2))


def test_winner_of_signed_zeros() -> None:
    values = torch.tensor([[[-0.0], [0.0], [-0.0]]], requires_grad=True)
    max_over_points(values).sum().backward()
    assert values.grad is not None
    assert values.grad.sum() == 1
