# SPDX-License-Identifier: Apache-2.0
"""Mean m and covariance S of rows, without a copy of the centred rows.

With x the rows and R their number, dL/dx = dL/dm / R + (x - m) (dL/dS + dL/dS^T) / R. That is affine in x, and is
added in place to the gradient that the rows have from their other use.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from doorstate.networks.kernels.pieces import on_cpu, pieces


def with_moments(rows: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return rows unchanged, their mean and their covariance, sharing one gradient.

    The gradient of the moments is added in place to that of the returned rows: pass them to exactly one operation, one
    that makes a new gradient.

    Args:
        rows: (R, C).

    Returns:
        (R, C) rows, (C,) mean and (C, C) covariance divided by R, both at least float32.
    """
    return _moments(rows)


class _WithMoments(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, rows: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        count, channels = rows.shape
        wide = torch.promote_types(rows.dtype, torch.float32)
        mean = rows.mean(0, dtype=wide)
        centre = mean.to(rows.dtype)
        covariance = torch.zeros(channels, channels, dtype=wide, device=rows.device)
        # The sum of a piece is rounded to the type of the rows. Large pieces, of a device, would leave that rounding.
        kind = rows.dtype if on_cpu(rows) else wide
        for piece in pieces(count, 2 * channels, rows):
            centred = rows[piece].to(kind) - centre
            covariance += centred.T @ centred
        covariance = covariance / count - torch.outer(mean - centre, mean - centre)
        ctx.save_for_backward(rows, mean)
        return rows.view_as(rows), mean, covariance

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor, mean_grad: Tensor, covariance_grad: Tensor) -> Tensor:
        rows, mean = ctx.saved_tensors
        slope = (covariance_grad + covariance_grad.T) / len(rows)
        rounded = slope.to(grad.dtype)
        # The mean is multiplied by the rounded slope, as the rows are below, so that both cancel.
        constant = (mean_grad / len(rows) - mean @ rounded.to(slope.dtype)).to(grad.dtype)
        for piece in pieces(len(rows), 2 * rows.shape[1], rows):
            grad[piece].add_(torch.addmm(constant, rows[piece], rounded))
        return grad


_moments: Callable[[Tensor], tuple[Tensor, Tensor, Tensor]] = _WithMoments.apply
