# SPDX-License-Identifier: Apache-2.0
"""Maxima over points and their gradients: ties, zeros of both signs."""

from __future__ import annotations

import pytest
import torch

from doorstate.networks.kernels.max_over_points import max_over_points
from tests.networks.twins import assert_same, rows


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
