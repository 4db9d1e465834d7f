# SPDX-License-Identifier: Apache-2.0
"""Linear layer and ReLU in pieces, against the chain of torch."""

from __future__ import annotations

import torch
from torch.nn import functional

from doorstate.networks.kernels.linear_relu import linear_relu
from tests.networks.twins import assert_same, rows


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
