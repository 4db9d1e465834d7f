# SPDX-License-Identifier: Apache-2.0
"""Depthwise, then pointwise convolution over neighbours, in both orders."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor

from doorstate.networks.kernels.separable import separable, weigh_neighbours
from tests.networks.twins import assert_same, rows


@pytest.mark.parametrize("multiples", [1, 3])
def test_weighed_neighbours_are_a_sum_of_products(multiples: int) -> None:
    assert_same(
        weigh_neighbours,
        lambda x, weight: torch.einsum("bpkc,kcm->bpmc", x, weight),
        rows(2, 6, 4, 5),
        rows(4, 5, multiples, seed=1),
    )


@pytest.mark.parametrize("k", [3, 700])
def test_both_orders_equal_two_convolutions(k: int) -> None:
    """Few values per neighbourhood take one combined product, many take two steps."""

    def literal(x: Tensor, depthwise: Tensor, pointwise: Tensor) -> Tensor:
        weighed = torch.einsum("bpkc,kcm->bpcm", x, depthwise)
        return weighed.flatten(2) @ pointwise.T

    assert_same(separable, literal, rows(2, 2, k, 4) / k, rows(k, 4, 2, seed=1), rows(5, 8, seed=2))
