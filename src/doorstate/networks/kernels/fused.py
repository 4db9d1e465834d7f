# SPDX-License-Identifier: Apache-2.0
"""A linear layer together with what follows it, so that less is written down; each with its own gradient.

A plain twin of each is in the tests. Work is done on pieces that stay in a core's cache.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable
from torch.nn import functional

from doorstate.networks.kernels.ops import (
    autocast_type,
    first_winner,
    flat_rows,
    full_precision,
    pieces,
    put_along,
    wants_gradient,
)

_GROUP = 64  # points of which only the largest are compared further


def linear_max(rows: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
    """max over points of W x + b, whose gradient is spread no wider than the points that have a maximum.

    Args:
        rows: (G, N, C).
        weight: (C', C).
        bias: (C',).

    Returns:
        (G, C') in the type autocast asks for.
    """
    kind = autocast_type(rows)
    with full_precision(rows):
        rows, weight, bias = rows.to(kind), weight.to(kind), bias.to(kind)
        if torch.compiler.is_exporting():
            return functional.linear(rows, weight).amax(1) + bias
        if not wants_gradient(rows, weight):
            return _linear_amax(rows, weight) + bias
        return _max_linear(rows, weight) + bias


def linear_relu(rows: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
    """ReLU(W x + b) of coordinates in their own precision, rounded once to the type autocast asks for.

    Args:
        rows: (R, C), C small.
        weight: (C', C).
        bias: (C',).

    Returns:
        (R, C').
    """
    kind = autocast_type(rows)
    with full_precision(rows):
        if not wants_gradient(rows, weight):
            return functional.linear(rows, weight, bias).relu_().to(kind)
        return _relu_linear(rows, weight, bias, kind)


def linear_norm_max(
    groups: Tensor, weight: Tensor, scale: Tensor, shift: Tensor, eps: float
) -> tuple[Tensor, Tensor, Tensor]:
    """max over points of BatchNorm(W x) with the batch's statistics, whose gradient never exists as rows of zeros.

    Args:
        groups: (G, K, C).
        weight: (C', C).
        scale: (C',) of the normalisation, of either sign.
        shift: (C',) of the normalisation.
        eps: of the normalisation.

    Returns:
        (G, C') in the type autocast asks for; (C',) mean and (C',) variance of W x, divided by G K, without gradient.
    """
    kind = autocast_type(groups)
    with full_precision(groups):
        return _norm_max(groups.to(kind), weight, scale, shift, eps)


def with_moments(rows: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Rows as they are, their mean and their covariance, sharing one gradient.

    The rows' gradient is that of whatever uses them with the moments' added in place: give the rows returned to one
    operation that makes a fresh gradient, and to no other.

    Args:
        rows: (R, C).

    Returns:
        (R, C) rows, (C,) mean and (C, C) covariance divided by R, both at least float32.
    """
    return _moments(rows)


def _linear_amax(rows: Tensor, weight: Tensor) -> Tensor:
    out = rows.new_empty(len(rows), len(weight))
    for piece in pieces(len(rows), rows.shape[1] * len(weight)):
        torch.amax(functional.linear(rows[piece], weight), 1, out=out[piece])
    return out


class _LinearMax(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, rows: Tensor, weight: Tensor) -> Tensor:
        out = rows.new_empty(len(rows), len(weight))
        winners = torch.empty(out.shape, dtype=torch.int64, device=rows.device)
        for group, (largest, winner) in enumerate(zip(out, winners, strict=True)):
            largest[:], winner[:] = _winner_in_groups(functional.linear(rows[group], weight))
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


class _LinearReLU(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, rows: Tensor, weight: Tensor, bias: Tensor, kind: torch.dtype) -> Tensor:
        out = rows.new_empty(len(rows), len(weight), dtype=kind)
        for piece in pieces(len(rows), len(weight)):
            out[piece] = torch.addmm(bias, rows[piece], weight.T).relu_()
        ctx.save_for_backward(rows, weight, out)
        return out

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor | None, ...]:
        rows, weight, out = ctx.saved_tensors
        weight_grad, bias_grad = torch.zeros_like(weight), weight.new_zeros(len(weight))
        rows_grad = torch.empty_like(rows) if ctx.needs_input_grad[0] else None
        for piece in pieces(len(rows), len(weight)):
            inner = (grad[piece] * out[piece].sign()).to(rows.dtype)
            weight_grad += inner.T @ rows[piece]
            bias_grad += inner.sum(0)
            if rows_grad is not None:
                torch.mm(inner, weight, out=rows_grad[piece])
        return rows_grad, weight_grad, bias_grad, None


class _LinearNormMax(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any, groups: Tensor, weight: Tensor, scale: Tensor, shift: Tensor, eps: float
    ) -> tuple[Tensor, Tensor, Tensor]:
        # With the sign of the scale in the weights, the largest output is the largest after normalisation.
        sign = torch.where(scale < 0, -1.0, 1.0).to(scale.dtype)
        signed = (weight * sign.unsqueeze(1)).to(groups.dtype)
        outputs = functional.linear(groups, signed).flatten(0, 1)
        one, none = torch.ones_like(scale), torch.zeros_like(scale)
        outputs, mean, inverse = torch.native_batch_norm(outputs, one, none, None, None, True, 0.0, eps)
        outputs = outputs.view(*groups.shape[:2], -1)  # (G, K, C') normalised
        best = outputs.new_empty(len(groups), len(weight))
        winners = torch.empty(best.shape, dtype=torch.int64, device=groups.device)
        for piece in pieces(len(groups), outputs[0].numel()):
            best[piece], winners[piece] = first_winner(outputs[piece])
        ctx.save_for_backward(groups, signed, outputs, winners, best, scale, sign, inverse)
        variance = inverse.square().reciprocal() - eps
        ctx.mark_non_differentiable(mean, variance)
        return (best * scale.abs() + shift).to(groups.dtype), mean * sign, variance

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor, *_: Tensor) -> tuple[Tensor | None, ...]:
        """Batch norm's own gradient is affine in its inputs, and only winners have more: no dense gradient is read."""
        groups, signed, outputs, winners, best, scale, sign, inverse = ctx.saved_tensors
        kind, count = groups.dtype, outputs.shape[0] * outputs.shape[1]
        grad = grad.to(scale.dtype)
        shift_grad, scale_grad = grad.sum(0), (grad * best).sum(0)
        slope = scale.abs() * inverse
        factor, constant = -slope * scale_grad / count, (-slope * shift_grad / count).to(kind)
        factor, won = factor.to(kind), (slope * grad).to(kind).unsqueeze(1)  # (C',), (G, 1, C')
        weight_grad = scale.new_zeros(signed.shape)
        groups_grad = torch.empty_like(groups) if ctx.needs_input_grad[0] else None
        for piece in pieces(len(groups), outputs[0].numel()):
            inner = torch.addcmul(constant, outputs[piece], factor)  # (g, K, C')
            place = winners[piece].unsqueeze(1)
            put_along(inner, place, inner.gather(1, place) + won[piece])
            flat = inner.flatten(0, 1)
            weight_grad += flat.T @ groups[piece].flatten(0, 1)
            if groups_grad is not None:
                torch.mm(flat, signed, out=groups_grad[piece].view(-1, groups.shape[2]))
        return groups_grad, weight_grad * sign.unsqueeze(1), scale_grad * sign, shift_grad, None


def _winner_in_groups(values: Tensor) -> tuple[Tensor, Tensor]:
    """Maximum over the (N, C) values of each channel and the first index that has it."""
    if len(values) % _GROUP:
        largest, winner = first_winner(values.unsqueeze(0))
        return largest[0], winner[0]
    groups = values.view(-1, _GROUP, values.shape[1])
    largest, group = groups.amax(1).max(0)  # (C,)
    members = groups.gather(0, group.view(1, 1, -1).expand(1, _GROUP, -1))  # (1, 64, C)
    return largest, group * _GROUP + first_winner(members)[1][0]


class _WithMoments(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, rows: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        count, channels = rows.shape
        wide = torch.promote_types(rows.dtype, torch.float32)
        mean = rows.mean(0, dtype=wide)
        centre = mean.to(rows.dtype)
        covariance = torch.zeros(channels, channels, dtype=wide, device=rows.device)
        for piece in pieces(count, 2 * channels):
            centred = rows[piece] - centre
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
        constant = (mean_grad / len(rows) - mean @ rounded.to(slope.dtype)).to(
            grad.dtype
        )  # cancels what is added
        for piece in pieces(len(rows), 2 * rows.shape[1]):
            grad[piece].add_(torch.addmm(constant, rows[piece], rounded))
        return grad


_max_linear: Callable[[Tensor, Tensor], Tensor] = _LinearMax.apply
_relu_linear: Callable[[Tensor, Tensor, Tensor, torch.dtype], Tensor] = _LinearReLU.apply
_norm_max: Callable[[Tensor, Tensor, Tensor, Tensor, float], tuple[Tensor, Tensor, Tensor]] = (
    _LinearNormMax.apply
)
_moments: Callable[[Tensor], tuple[Tensor, Tensor, Tensor]] = _WithMoments.apply
