# SPDX-License-Identifier: Apache-2.0
"""Maximum over points of a linear layer, against the chain of torch."""

from __future__ import annotations

import pytest
import torch
from torch.nn import functional

from doorstate.networks.kernels.linear_max import linear_max
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
