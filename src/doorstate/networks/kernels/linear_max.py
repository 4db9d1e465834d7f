# SPDX-License-Identifier: Apache-2.0
"""Maximum over points of a linear layer, out = max_i (W x_i + b).

The bias is the same for all points, so max_i (W x_i + b) = (max_i W x_i) + b. Only the points that win a channel have
a gradient: dW sums grad[c] x_winner(c), and the gradient of the points is grad[c] W[c] at the winners, zero
elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable
from torch.nn import functional

from doorstate.networks.kernels.gather import flat_rows
from doorstate.networks.kernels.pieces import on_cpu, pieces
from doorstate.networks.kernels.precision import autocast_type, full_precision, wants_gradient
from doorstate.networks.kernels.winners import first_winner

_GROUP = 64  # points; only the largest of a group is compared further


def linear_max(rows: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
    """Return the maximum over points of W x + b.

    Args:
        rows: (G, N, C).
        weight: (C', C).
        bias: (C',).

    Returns:
        (G, C') in the type of autocast.
    """
    kind = autocast_type(rows)
    with full_precision(rows):
        rows, weight, bias = rows.to(kind), weight.to(kind), bias.to(kind)
        if torch.compiler.is_exporting():
            return functional.linear(rows, weight).amax(1) + bias
        if not wants_gradient(rows, weight):
            return _linear_amax(rows, weight) + bias
        return _max_linear(rows, weight) + bias


def _linear_amax(rows: Tensor, weight: Tensor) -> Tensor:
    out = rows.new_empty(len(rows), len(weight))
    for piece in pieces(len(rows), rows.shape[1] * len(weight), rows):
        torch.amax(functional.linear(rows[piece], weight), 1, out=out[piece])
    return out


class _LinearMax(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, rows: Tensor, weight: Tensor) -> Tensor:
        out = rows.new_empty(len(rows), len(weight))
        winners = torch.empty(out.shape, dtype=torch.int64, device=rows.device)
        if on_cpu(rows):
            for group, (largest, winner) in enumerate(zip(out, winners, strict=True)):
                largest[:], winner[:] = _winner_in_groups(functional.linear(rows[group], weight))
        else:
            for piece in pieces(len(rows), rows.shape[1] * len(weight), rows):
                out[piece], winners[piece] = first_winner(functional.linear(rows[piece], weight))
        ctx.save_for_backward(rows, weight, winners)
        return out

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor | None, Tensor]:
        rows, weight, winners = ctx.saved_tensors
        flat, places = rows.flatten(0, 1), flat_rows(rows, winners).flatten()
        picked = flat.index_select(0, places).view(*winners.shape, -1)  # (G, C', C)
        weight_grad = torch.einsum("gc,gcd->cd", grad, picked)
        if not ctx.needs_input_grad[0]:
            return None, weight_grad
        # Some points win many channels: their sum needs more digits than bfloat16 has.
        spread = torch.zeros_like(flat, dtype=torch.promote_types(flat.dtype, torch.float32))
        spread.index_add_(0, places, (grad.unsqueeze(-1).to(spread.dtype) * weight).flatten(0, 1))
        return spread.to(rows.dtype).view_as(rows), weight_grad


def _winner_in_groups(values: Tensor) -> tuple[Tensor, Tensor]:
    """Return the (C,) maximum of (N, C) values and the first index that has it, comparing groups first."""
    if len(values) % _GROUP:
        largest, winner = first_winner(values.unsqueeze(0))
        return largest[0], winner[0]
    groups = values.view(-1, _GROUP, values.shape[1])
    largest, group = groups.amax(1).max(0)  # (C,)
    members = groups.gather(0, group.view(1, 1, -1).expand(1, _GROUP, -1))  # (1, 64, C)
    return largest, group * _GROUP + first_winner(members)[1][0]


_max_linear: Callable[[Tensor, Tensor], Tensor] = _LinearMax.apply
