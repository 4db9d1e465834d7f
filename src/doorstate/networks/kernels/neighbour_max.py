# SPDX-License-Identifier: Apache-2.0
"""Maximum over each point's neighbours, out[i, c] = max_j x[n(i, j), c].

Neighbours are gathered in pieces that stay in the cache, so the (M, k, C) tensor of all neighbours never exists.
Backward needs only the row that won each channel.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from doorstate.networks.kernels.gather import flat_rows, gather_rows
from doorstate.networks.kernels.pieces import pieces
from doorstate.networks.kernels.precision import wants_gradient
from doorstate.networks.kernels.winners import first_winner


def neighbour_max(values: Tensor, indices: Tensor) -> Tensor:
    """Return the (B, M, C) maximum over neighbours, of (B, N, C) values and (B, M, k) indices.

    The gradient goes to the first neighbour that has the maximum.
    """
    if torch.compiler.is_exporting():
        return gather_rows(values, indices).amax(2)
    if not wants_gradient(values):
        return _neighbour_amax(values, indices)
    return _max_neighbours(values, indices)


def _neighbour_amax(values: Tensor, indices: Tensor) -> Tensor:
    batch, num_queries, k = indices.shape
    flat, rows = values.flatten(0, 1), flat_rows(values, indices).flatten(0, 1)  # (B * N, C), (B * M, k)
    out = flat.new_empty(len(rows), flat.shape[1])
    for piece in pieces(len(rows), k * flat.shape[1], flat):
        torch.amax(flat.index_select(0, rows[piece].flatten()).view(-1, k, flat.shape[1]), 1, out=out[piece])
    return out.view(batch, num_queries, -1)


class _NeighbourMax(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, values: Tensor, indices: Tensor) -> Tensor:
        batch, num_queries, k = indices.shape
        flat, rows = values.flatten(0, 1), flat_rows(values, indices).flatten(0, 1)
        channels = flat.shape[1]
        out = flat.new_empty(len(rows), channels)
        winners = torch.empty(len(rows), channels, dtype=torch.int64, device=values.device)
        for piece in pieces(len(rows), k * channels, flat):
            neighbours = flat.index_select(0, rows[piece].flatten()).view(-1, k, channels)
            out[piece], slot = first_winner(neighbours)
            torch.gather(rows[piece], 1, slot, out=winners[piece])
        ctx.save_for_backward(winners)
        ctx.shape = values.shape
        return out.view(batch, num_queries, channels)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, None]:
        (winners,) = ctx.saved_tensors
        place = winners * grad.shape[-1] + torch.arange(grad.shape[-1], device=grad.device)
        spread = grad.new_zeros(ctx.shape)
        spread.view(-1).index_add_(0, place.view(-1), grad.reshape(-1))
        return spread, None


_max_neighbours: Callable[[Tensor, Tensor], Tensor] = _NeighbourMax.apply
