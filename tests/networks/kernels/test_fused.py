# SPDX-License-Identifier: Apache-2.0
"""Linear layers together with what follows them against the ordinary chain of torch: values and gradients."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor
from torch.nn import functional

from doorstate.networks.kernels.fused import linear_max, linear_norm_max, linear_relu, with_moments
from tests.networks.twins import assert_same, rows


@pytest.mark.parametrize("count", [20, 64, 192])
def test_linear_max_is_the_maximum_of_the_linear_layer(count: int) -> None:
    values = rows(3, count, 6)
    values[:, -1] = values[:, 0]  # a duplicate point: the first gets the gradient
    weight, bias = rows(10, 6, seed=1), rows(10, seed=2)
    assert_same(linear_max, lambda x, w, b: functional.linear(x, w, b).max(1).values, values, weight, bias)
    with torch.no_grad():
        expected = functional.linear(values, weight, bias).amax(1)
        torch.testing.assert_close(linear_max(values, weight, bias), expected)


def test_linear_max_without_a_gradient_of_the_rows() -> None:
    values, weight = rows(2, 64, 3), rows(4, 3, seed=1).requires_grad_()
    linear_max(values, weight, rows(4, seed=2)).sum().backward()
    got, weight.grad = weight.grad, None
    functional.linear(values, weight).amax(1).sum().backward()
    torch.testing.assert_close(got, weight.grad)


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


def test_linear_relu_is_linear_then_relu() -> None:
    assert_same(
        linear_relu, lambda x, w, b: functional.linear(x, w, b).relu(), rows(50, 3), rows(7, 3), rows(7)
    )


def test_linear_relu_rounds_once_under_autocast() -> None:
    values, weight, bias = rows(50, 3).float(), rows(7, 3).float().requires_grad_(), rows(7).float()
    exact = functional.linear(values, weight, bias).relu()
    with torch.autocast("cpu", dtype=torch.bfloat16):
        rounded = linear_relu(values, weight, bias)
        with torch.no_grad():
            assert torch.equal(linear_relu(values, weight, bias), rounded)
    assert torch.equal(rounded, exact.bfloat16())
    rounded.sum().backward()
    got, weight.grad = weight.grad, None
    exact.sum().backward()
    torch.testing.assert_close(got, weight.grad)
