# SPDX-License-Identifier: Apache-2.0
"""Maximum over the points of each cloud or neighbourhood, out[c] = max_i x[i, c].

The gradient of a maximum goes to the first point that has it. Keeping that index alone, instead of all values, makes
the backward pass a scatter of one value per channel.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from doorstate.networks.kernels.pieces import pieces
from doorstate.networks.kernels.precision import wants_gradient
from doorstate.networks.kernels.winners import first_winner, put_along


def max_over_points(values: Tensor) -> Tensor:
    """Return the (..., C) maximum over the axis before the last of (..., N, C) values."""
    if torch.compiler.is_exporting() or not wants_gradient(values):
        return values.amax(-2)
    return _max_points(values)


class _MaxOverPoints(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, values: Tensor) -> Tensor:
        groups = values.flatten(0, -3)  # (G, K, C)
        out = groups.new_empty(len(groups), groups.shape[2])
        winners = torch.empty(out.shape, dtype=torch.int64, device=values.device)
        for piece in pieces(len(groups), groups[0].numel(), groups):
            out[piece], winners[piece] = first_winner(groups[piece])
        ctx.save_for_backward(winners)
        ctx.shape = values.shape
        return out.view(*values.shape[:-2], -1)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> Tensor:
        (winners,) = ctx.saved_tensors
        spread = grad.new_zeros(ctx.shape)
        put_along(spread.flatten(0, -3), winners.unsqueeze(1), grad.reshape(len(winners), 1, -1))
        return spread


_max_points: Callable[[Tensor], Tensor] = _MaxOverPoints.apply
