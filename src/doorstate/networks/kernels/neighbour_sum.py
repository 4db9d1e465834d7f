# SPDX-License-Identifier: Apache-2.0
"""Sum over each point's neighbours, out[i] = sum_j x[n(i, j)], as torch's embedding bag.

Backward is the same sum on the reversed graph: grad[p] = sum of the gradients of all i that have p as a neighbour.
Edges sorted by their end point make these sums another embedding bag.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable
from torch.nn import functional

from doorstate.networks.kernels.gather import flat_rows


def neighbour_sum(values: Tensor, indices: Tensor) -> Tensor:
    """Return the (B, M, C) sum over neighbours, of (B, N, C) values and (B, M, k) indices."""
    return _sum_neighbours(values, indices)


class _NeighbourSum(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, values: Tensor, indices: Tensor) -> Tensor:
        bags = flat_rows(values, indices).flatten(0, 1)  # (B * M, k)
        ctx.save_for_backward(bags)
        ctx.shape = values.shape
        return functional.embedding_bag(bags, values.flatten(0, 1), mode="sum").view(*indices.shape[:2], -1)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, None]:
        """Sum over the queries that have a point as a neighbour."""
        (bags,) = ctx.saved_tensors
        num_points = ctx.shape[0] * ctx.shape[1]
        points, edges = bags.flatten().sort()
        first = torch.searchsorted(points, torch.arange(num_points, device=grad.device))
        queries = edges // bags.shape[1]
        spread = functional.embedding_bag(queries, grad.flatten(0, 1).contiguous(), first, mode="sum")
        return spread.view(ctx.shape), None


_sum_neighbours: Callable[[Tensor, Tensor], Tensor] = _NeighbourSum.apply
