# SPDX-License-Identifier: Apache-2.0
"""Two ways to compute one thing, compared: values and gradients."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor


def rows(*shape: int, seed: int = 0) -> Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed)).double()


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
