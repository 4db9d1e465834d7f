# SPDX-License-Identifier: Apache-2.0
"""Comparison of a fast form with a literal one: values and gradients."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor


def rows(*shape: int, seed: int = 0) -> Tensor:
    return random_rows(*shape, seed=seed).double()


def random_rows(*shape: int, seed: int = 0) -> Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


def random_indices(batch: int, queries: int, points: int, k: int) -> Tensor:
    return torch.randint(0, points, (batch, queries, k), generator=torch.Generator().manual_seed(1))


def assert_same(fast: Callable[..., Tensor], literal: Callable[..., Tensor], *inputs: Tensor) -> None:
    """Same values and same gradients of every input, in float64 and, less closely, in float32."""
    for dtype, tolerance in ((torch.float64, 1e-9), (torch.float32, 1e-4)):
        results = []
        for form in (fast, literal):
            leaves = [x.to(dtype).detach().requires_grad_() for x in inputs]
            out = form(*leaves)
            weights = torch.linspace(-1, 2, out.numel(), dtype=dtype).view_as(out)
            results.append([out, *torch.autograd.grad((out * weights).sum(), leaves)])
        for got, expected in zip(*results, strict=True):
            torch.testing.assert_close(got, expected, rtol=tolerance, atol=tolerance)
