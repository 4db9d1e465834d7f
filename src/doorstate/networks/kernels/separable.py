# SPDX-License-Identifier: Apache-2.0
"""Depthwise convolution over neighbours, then a linear layer over channels (PointCNN).

The two steps are

    z[c, m] = sum_k D[k, c, m] x[k, c],   y[o] = sum_cm W[o, cm] z[c, m].

Nothing comes between them, so they are one product, y[o] = sum_kc (sum_m W[o, cm] D[k, c, m]) x[k, c]. With few values
per neighbourhood that is cheaper than a pass over memory for z. With many it is more arithmetic than it saves, and the
two steps remain.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable
from torch.nn import functional

from doorstate.networks.kernels.pieces import on_cpu
from doorstate.networks.kernels.precision import at_least_float32, full_precision

# The first three levels of PointCNN have 192, 720 and 1920 values per neighbourhood, the last has 3840.
_MAX_VALUES_COMBINED = 2048


def separable(rows: Tensor, depthwise: Tensor, pointwise: Tensor) -> Tensor:
    """Weigh the neighbours of each channel, then mix the channels.

    Args:
        rows: (B, P, K, C).
        depthwise: (K, C, m).
        pointwise: (C_out, C * m).

    Returns:
        (B, P, C_out).
    """
    k, channels, multiplier = depthwise.shape
    mixing = pointwise.view(-1, channels, multiplier)
    if k * channels <= _MAX_VALUES_COMBINED:
        with full_precision(rows):
            weight = torch.einsum("kcm,ocm->okc", depthwise, mixing)
        return functional.linear(rows.flatten(2), weight.flatten(1))
    weighed = weigh_neighbours(rows, depthwise)  # (B, P, m, C)
    return functional.linear(weighed.flatten(2), mixing.transpose(1, 2).flatten(1))


def weigh_neighbours(rows: Tensor, weight: Tensor) -> Tensor:
    """Return the (B, P, m, C) weighted sums over neighbours, of (B, P, K, C) rows and (K, C, m) weights.

    One pass over the rows in memory order; on a CPU, a product per channel would transpose them first.
    """
    if torch.compiler.is_exporting() or not on_cpu(rows):
        return torch.einsum("bpkc,kcm->bpmc", rows, weight)
    return _weigh_neighbours(rows, weight)


class _WeighNeighbours(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, rows: Tensor, weight: Tensor) -> Tensor:
        ctx.save_for_backward(rows, weight)
        flat = rows.flatten(0, 1)
        out = weight.new_zeros(len(flat), weight.shape[2], weight.shape[1])
        for slot, weights in enumerate(weight):
            row = at_least_float32(flat[:, slot])
            for multiple, column in enumerate(weights.unbind(1)):
                out[:, multiple].addcmul_(row, column)
        return out.view(*rows.shape[:2], *out.shape[1:]).to(rows.dtype)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, Tensor]:
        rows, weight = ctx.saved_tensors
        flat = rows.flatten(0, 1)
        grads = [column.contiguous() for column in at_least_float32(grad.flatten(0, 1)).unbind(1)]
        rows_grad, weight_grad = torch.empty_like(flat), torch.empty_like(weight)
        product = torch.empty_like(grads[0])
        for slot, weights in enumerate(weight):
            row = at_least_float32(flat[:, slot])
            for multiple, column_grad in enumerate(grads):
                weight_grad[slot, :, multiple] = torch.mul(column_grad, row, out=product).sum(0)
            product.zero_()
            for column, column_grad in zip(weights.unbind(1), grads, strict=True):
                product.addcmul_(column_grad, column)
            rows_grad[:, slot] = product
        return rows_grad.view_as(rows), weight_grad


_weigh_neighbours: Callable[[Tensor, Tensor], Tensor] = _WeighNeighbours.apply
