# SPDX-License-Identifier: Apache-2.0
"""Maximum over points of BatchNorm(W x_i), with the statistics of the batch.

With z = W x and its normalised form n, the layer is y = s n + t. If s >= 0, the maximum of y is s max(n) + t. If s < 0,
the sign goes into W first, which makes the minimum a maximum. So the largest output before scaling is the largest
after it.

Let g[c] be the gradient of the maximum, which only winners receive. Batch normalisation spreads it over all R rows as
s/std (g - mean(g) - n mean(g n)): affine in n but for the winners. The dense gradient is built from n piece by piece
and never exists as rows of zeros.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable
from torch.nn import functional

from doorstate.networks.kernels.pieces import pieces
from doorstate.networks.kernels.precision import autocast_type, full_precision
from doorstate.networks.kernels.winners import first_winner, put_along


def linear_norm_max(
    groups: Tensor, weight: Tensor, scale: Tensor, shift: Tensor, eps: float
) -> tuple[Tensor, Tensor, Tensor]:
    """Return the maximum over points of BatchNorm(W x) with the statistics of the batch.

    Args:
        groups: (G, K, C).
        weight: (C', C).
        scale: (C',) of the normalisation, of either sign.
        shift: (C',) of the normalisation.
        eps: epsilon of the normalisation.

    Returns:
        (G, C') in the type of autocast; (C',) mean and (C',) variance, divided by G K, of W x, without gradient.
    """
    kind = autocast_type(groups)
    with full_precision(groups):
        return _norm_max(groups.to(kind), weight, scale, shift, eps)


class _LinearNormMax(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any, groups: Tensor, weight: Tensor, scale: Tensor, shift: Tensor, eps: float
    ) -> tuple[Tensor, Tensor, Tensor]:
        # With the sign of the scale in the weights, the largest output is the largest after normalisation.
        sign = torch.where(scale < 0, -1.0, 1.0).to(scale.dtype)
        signed = (weight * sign.unsqueeze(1)).to(groups.dtype)
        outputs = functional.linear(groups, signed).flatten(0, 1)
        ones, zeros = torch.ones_like(scale), torch.zeros_like(scale)
        outputs, mean, inverse = torch.native_batch_norm(outputs, ones, zeros, None, None, True, 0.0, eps)
        outputs = outputs.view(*groups.shape[:2], -1)  # (G, K, C') normalised
        best = outputs.new_empty(len(groups), len(weight))
        winners = torch.empty(best.shape, dtype=torch.int64, device=groups.device)
        for piece in pieces(len(groups), outputs[0].numel(), groups):
            best[piece], winners[piece] = first_winner(outputs[piece])
        ctx.save_for_backward(groups, signed, outputs, winners, best, scale, sign, inverse)
        variance = inverse.square().reciprocal() - eps
        ctx.mark_non_differentiable(mean, variance)
        return (best * scale.abs() + shift).to(groups.dtype), mean * sign, variance

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor, *_: Tensor) -> tuple[Tensor | None, ...]:
        groups, signed, outputs, winners, best, scale, sign, inverse = ctx.saved_tensors
        kind, count = groups.dtype, outputs.shape[0] * outputs.shape[1]
        grad = grad.to(scale.dtype)
        shift_grad, scale_grad = grad.sum(0), (grad * best).sum(0)
        slope = scale.abs() * inverse
        factor, constant = -slope * scale_grad / count, (-slope * shift_grad / count).to(kind)
        factor, won = factor.to(kind), (slope * grad).to(kind).unsqueeze(1)  # (C',), (G, 1, C')
        weight_grad = scale.new_zeros(signed.shape)
        groups_grad = torch.empty_like(groups) if ctx.needs_input_grad[0] else None
        for piece in pieces(len(groups), outputs[0].numel(), groups):
            inner = torch.addcmul(constant, outputs[piece], factor)  # (g, K, C')
            place = winners[piece].unsqueeze(1)
            put_along(inner, place, inner.gather(1, place) + won[piece])
            flat = inner.flatten(0, 1)
            weight_grad += flat.T @ groups[piece].flatten(0, 1)
            if groups_grad is not None:
                torch.mm(flat, signed, out=groups_grad[piece].view(-1, groups.shape[2]))
        return groups_grad, weight_grad * sign.unsqueeze(1), scale_grad * sign, shift_grad, None


_norm_max: Callable[[Tensor, Tensor, Tensor, Tensor, float], tuple[Tensor, Tensor, Tensor]] = (
    _LinearNormMax.apply
)
