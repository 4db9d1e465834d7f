# SPDX-License-Identifier: Apache-2.0
"""Mean and covariance of rows, and their joint gradient."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from doorstate.networks.kernels.moments import with_moments
from tests.networks.twins import assert_same, rows


def test_moments_and_their_gradient_join_that_of_the_rows() -> None:
    values, weight = rows(70, 4) * torch.tensor([1, 2, 3, 0.1]) + 5, rows(3, 4, seed=1)

    def fast(x: Tensor, w: Tensor) -> Tensor:
        x, mean, covariance = with_moments(x)
        return torch.cat([functional.linear(x, w).exp().flatten(), mean.square(), covariance.sin().flatten()])

    def literal(x: Tensor, w: Tensor) -> Tensor:
        covariance = x.T.cov(correction=0)
        return torch.cat(
            [functional.linear(x, w).exp().flatten(), x.mean(0).square(), covariance.sin().flatten()]
        )

    assert_same(fast, literal, values / 10, weight)


def test_moments_of_rows_far_from_zero_do_not_cancel() -> None:
    values = rows(500, 3)
    _, mean, covariance = with_moments((values + 1000).float())
    torch.testing.assert_close(mean.double() - 1000, values.mean(0), rtol=0, atol=1e-4)
    torch.testing.assert_close(covariance.double(), values.T.cov(correction=0), rtol=0, atol=1e-3)
