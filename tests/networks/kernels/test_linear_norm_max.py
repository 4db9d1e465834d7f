# SPDX-License-Identifier: Apache-2.0
"""Maximum over points of a normalised linear layer, against the chain of torch."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor
from torch.nn import functional

from doorstate.networks.kernels.linear_norm_max import linear_norm_max
from tests.networks.twins import assert_same, rows


@pytest.mark.parametrize("count", [1, 8, 130])
def test_normalised_maximum_is_that_of_batch_norm(count: int) -> None:
    values = rows(40, count, 6) + 1
    weight, scale, shift = rows(10, 6, seed=1), torch.linspace(-1, 1, 10).double(), rows(10, seed=2)

    def literal(x: Tensor, w: Tensor, scale: Tensor, shift: Tensor) -> Tensor:
        flat = functional.linear(x, w).flatten(0, 1)
        normal = functional.batch_norm(flat, None, None, scale, shift, training=True, eps=1e-3)
        return normal.view(*x.shape[:2], -1).max(1).values

    assert_same(
        lambda x, w, a, b: linear_norm_max(x, w, a, b, 1e-3)[0], literal, values, weight, scale, shift
    )
    _, mean, variance = linear_norm_max(values, weight, scale, shift, 1e-3)
    outputs = functional.linear(values, weight).flatten(0, 1)
    torch.testing.assert_close(mean, outputs.mean(0))
    torch.testing.assert_close(variance, outputs.var(0, correction=0))
