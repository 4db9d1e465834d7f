# SPDX-License-Identifier: Apache-2.0
"""Operations on rows that torch has no quick form of: gathers, maxima, moments; each with its own gradient.

A plain twin of each is in the tests. Work is done on pieces that stay in a core's cache.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable
from torch.nn import functional

_VALUES_PER_PIECE = 2**19  # 2 MiB of float32
_BITS = {2: torch.int16, 4: torch.int32, 8: torch.int64}
_GROUP = 64  # points of which only the largest are compared further


def full_precision(tensor: Tensor) -> AbstractContextManager[object]:
    """Context in which autocast leaves operations on the tensor's device alone."""
    return torch.autocast(tensor.device.type, enabled=False) if _is_autocast(tensor) else nullcontext()


def at_least_float32(values: Tensor) -> Tensor:
    """Values as float32, or float64 if they are that already."""
    return values.to(torch.promote_types(values.dtype, torch.float32))


def autocast_type(tensor: Tensor) -> torch.dtype:
    """Type that autocast would compute a product with this tensor in."""
    return torch.get_autocast_dtype(tensor.device.type) if _is_autocast(tensor) else tensor.dtype


def gather_rows(values: Tensor, indices: Tensor) -> Tensor:
    """Pick rows of each cloud.

    Args:
        values: (B, N, C).
        indices: (B, ...) int64 row numbers within the same cloud.

    Returns:
        (B, ..., C). Uses index_select on flattened rows: the backward of `values[indices]` is slow on CPUs.
    """
    rows = _flat_rows(values, indices).reshape(-1)
    return values.flatten(0, 1).index_select(0, rows).view(*indices.shape, values.shape[-1])


def neighbour_sum(values: Tensor, indices: Tensor) -> Tensor:
    """Sum over each point's neighbours: (B, M, C) of (B, N, C) values and (B, M, k) indices."""
    return _sum_neighbours(values, indices)


def neighbour_max(values: Tensor, indices: Tensor) -> Tensor:
    """Maximum over each point's neighbours: (B, M, C) of (B, N, C) values and (B, M, k) indices.

    The gradient goes to the first neighbour that has the maximum.
    """
    if torch.compiler.is_exporting():
        return gather_rows(values, indices).amax(2)
    if not _wants_gradient(values):
        return _neighbour_amax(values, indices)
    return _max_neighbours(values, indices)


def max_over_points(values: Tensor) -> Tensor:
    """Maximum over the axis before the last; its gradient goes to the first point that has it."""
    if torch.compiler.is_exporting() or not _wants_gradient(values):
        return values.amax(-2)
    return _max_points(values)


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
        if not _wants_gradient(rows, weight):
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
        if not _wants_gradient(rows, weight):
            return functional.linear(rows, weight, bias).relu_().to(kind)
        return _relu_linear(rows, weight, bias, kind)


def linear_norm_max(
    groups: Tensor, weight: Tensor, scale: Tensor, shift: Tensor, eps: float
) -> tuple[Tensor, Tensor, Tensor]:
    """max over points of BatchNorm(W x) with the batch's statistics, the normalised rows never written.

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


def _is_autocast(tensor: Tensor) -> bool:
    device = tensor.device.type
    return torch.amp.is_autocast_available(device) and torch.is_autocast_enabled(device)


def _wants_gradient(*tensors: Tensor) -> bool:
    return torch.is_grad_enabled() and any(tensor.requires_grad for tensor in tensors)


def _flat_rows(values: Tensor, indices: Tensor) -> Tensor:
    """Row numbers in the flattened batch: (B, ...) like the indices."""
    batch, num_rows, _ = values.shape
    first_row = num_rows * torch.arange(batch, device=values.device)
    return indices + first_row.view(-1, *[1] * (indices.dim() - 1))


def _pieces(count: int, values_each: int) -> Iterator[slice]:
    size = max(1, _VALUES_PER_PIECE // values_each)
    return (slice(start, min(start + size, count)) for start in range(0, count, size))


def _first_winner(values: Tensor) -> tuple[Tensor, Tensor]:
    """Maximum over axis 1 of (G, K, C) values and the first index that has it, int64.

    A few vectorised passes: torch.max with indices over an axis that is not the last compares one by one.
    """
    num_points = values.shape[1]
    largest = values.amax(1, keepdim=True)
    if values.element_size() > 2:
        slots = torch.arange(num_points, dtype=values.dtype, device=values.device).view(1, -1, 1)
        behind = (largest - values).sign_()  # 0 where a value is the largest, else 1
        winner = torch.add(slots, behind, alpha=num_points).amin(1)
    else:  # too few digits to count with
        kind = torch.int8 if num_points < 2**7 else torch.int16 if num_points < 2**15 else torch.int32
        from_end = torch.arange(num_points, 0, -1, dtype=kind, device=values.device).view(1, -1, 1)
        has_it = (values.view(torch.int16) == largest.view(torch.int16)).view(torch.int8)
        winner = num_points - (has_it * from_end).amax(1)
    return largest.squeeze(1), winner.long().clamp_(0, num_points - 1)  # nothing equals NaN


def _neighbour_amax(values: Tensor, indices: Tensor) -> Tensor:
    batch, num_queries, k = indices.shape
    flat, rows = values.flatten(0, 1), _flat_rows(values, indices).flatten(0, 1)  # (B * N, C), (B * M, k)
    out = flat.new_empty(len(rows), flat.shape[1])
    for piece in _pieces(len(rows), k * flat.shape[1]):
        torch.amax(flat.index_select(0, rows[piece].flatten()).view(-1, k, flat.shape[1]), 1, out=out[piece])
    return out.view(batch, num_queries, -1)


def _linear_amax(rows: Tensor, weight: Tensor) -> Tensor:
    out = rows.new_empty(len(rows), len(weight))
    for piece in _pieces(len(rows), rows.shape[1] * len(weight)):
        torch.amax(functional.linear(rows[piece], weight), 1, out=out[piece])
    return out


class _NeighbourMax(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, values: Tensor, indices: Tensor) -> Tensor:
        batch, num_queries, k = indices.shape
        flat, rows = values.flatten(0, 1), _flat_rows(values, indices).flatten(0, 1)
        channels = flat.shape[1]
        out = flat.new_empty(len(rows), channels)
        winners = torch.empty(len(rows), channels, dtype=torch.int64, device=values.device)
        for piece in _pieces(len(rows), k * channels):
            neighbours = flat.index_select(0, rows[piece].flatten()).view(-1, k, channels)
            out[piece], slot = _first_winner(neighbours)
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


class _NeighbourSum(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, values: Tensor, indices: Tensor) -> Tensor:
        bags = _flat_rows(values, indices).flatten(0, 1)  # (B * M, k)
        ctx.save_for_backward(bags)
        ctx.shape = values.shape
        return functional.embedding_bag(bags, values.flatten(0, 1), mode="sum").view(*indices.shape[:2], -1)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, None]:
        """The same sum on the reversed graph: over the queries that have a point as a neighbour."""
        (bags,) = ctx.saved_tensors
        num_points = ctx.shape[0] * ctx.shape[1]
        points, edges = bags.flatten().sort()
        first = torch.searchsorted(points, torch.arange(num_points, device=grad.device))
        queries = edges // bags.shape[1]
        spread = functional.embedding_bag(queries, grad.flatten(0, 1).contiguous(), first, mode="sum")
        return spread.view(ctx.shape), None


class _MaxOverPoints(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, values: Tensor) -> Tensor:
        groups = values.flatten(0, -3)  # (G, K, C)
        out = groups.new_empty(len(groups), groups.shape[2])
        winners = torch.empty(out.shape, dtype=torch.int64, device=values.device)
        for piece in _pieces(len(groups), groups[0].numel()):
            out[piece], winners[piece] = _first_winner(groups[piece])
        ctx.save_for_backward(winners)
        ctx.shape = values.shape
        return out.view(*values.shape[:-2], -1)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> Tensor:
        (winners,) = ctx.saved_tensors
        spread = grad.new_zeros(ctx.shape)
        _put(spread.flatten(0, -3), winners.unsqueeze(1), grad.reshape(len(winners), 1, -1))
        return spread


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
        flat, places = rows.flatten(0, 1), _flat_rows(rows, winners).flatten()
        picked = flat.index_select(0, places).view(*winners.shape, -1)  # (G, C', C)
        weight_grad = torch.einsum("gc,gcd->cd", grad, picked)
        if not ctx.needs_input_grad[0]:
            return None, weight_grad
        spread = torch.zeros_like(flat)
        spread.index_add_(0, places, (grad.unsqueeze(-1) * weight).flatten(0, 1))
        return spread.view_as(rows), weight_grad


class _LinearReLU(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, rows: Tensor, weight: Tensor, bias: Tensor, kind: torch.dtype) -> Tensor:
        out = rows.new_empty(len(rows), len(weight), dtype=kind)
        for piece in _pieces(len(rows), len(weight)):
            out[piece] = torch.addmm(bias, rows[piece], weight.T).relu_()
        ctx.save_for_backward(rows, weight, out)
        return out

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor | None, ...]:
        rows, weight, out = ctx.saved_tensors
        weight_grad, bias_grad = torch.zeros_like(weight), weight.new_zeros(len(weight))
        rows_grad = torch.empty_like(rows) if ctx.needs_input_grad[0] else None
        for piece in _pieces(len(rows), len(weight)):
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
        for piece in _pieces(len(groups), outputs[0].numel()):
            best[piece], winners[piece] = _first_winner(outputs[piece])
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
        for piece in _pieces(len(groups), outputs[0].numel()):
            inner = torch.addcmul(constant, outputs[piece], factor)  # (g, K, C')
            place = winners[piece].unsqueeze(1)
            _put(inner, place, inner.gather(1, place) + won[piece])
            flat = inner.flatten(0, 1)
            weight_grad += flat.T @ groups[piece].flatten(0, 1)
            if groups_grad is not None:
                torch.mm(flat, signed, out=groups_grad[piece].view(-1, groups.shape[2]))
        return groups_grad, weight_grad * sign.unsqueeze(1), scale_grad * sign, shift_grad, None


def _put(values: Tensor, places: Tensor, new: Tensor) -> None:
    """Scatter along axis 1; as integers, because torch scatters bfloat16 four times as slowly."""
    bits = _BITS[values.element_size()]
    values.view(bits).scatter_(1, places, new.view(bits))


def _winner_in_groups(values: Tensor) -> tuple[Tensor, Tensor]:
    """Maximum over the (N, C) values of each channel and the first index that has it."""
    if len(values) % _GROUP:
        largest, winner = _first_winner(values.unsqueeze(0))
        return largest[0], winner[0]
    groups = values.view(-1, _GROUP, values.shape[1])
    largest, group = groups.amax(1).max(0)  # (C,)
    members = groups.gather(0, group.view(1, 1, -1).expand(1, _GROUP, -1))  # (1, 64, C)
    return largest, group * _GROUP + _first_winner(members)[1][0]


class _WithMoments(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, rows: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        count, channels = rows.shape
        wide = torch.promote_types(rows.dtype, torch.float32)
        mean = rows.mean(0, dtype=wide)
        centre = mean.to(rows.dtype)
        covariance = torch.zeros(channels, channels, dtype=wide, device=rows.device)
        for piece in _pieces(count, 2 * channels):
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
        constant = (mean_grad / len(rows) - mean @ slope).to(grad.dtype)
        slope = slope.to(grad.dtype)
        for piece in _pieces(len(rows), 2 * rows.shape[1]):
            grad[piece].addmm_(rows[piece], slope).add_(constant)
        return grad


_sum_neighbours: Callable[[Tensor, Tensor], Tensor] = _NeighbourSum.apply
_max_neighbours: Callable[[Tensor, Tensor], Tensor] = _NeighbourMax.apply
_max_points: Callable[[Tensor], Tensor] = _MaxOverPoints.apply
_max_linear: Callable[[Tensor, Tensor], Tensor] = _LinearMax.apply
_relu_linear: Callable[[Tensor, Tensor, Tensor, torch.dtype], Tensor] = _LinearReLU.apply
_norm_max: Callable[[Tensor, Tensor, Tensor, Tensor, float], tuple[Tensor, Tensor, Tensor]] = (
    _LinearNormMax.apply
)
_moments: Callable[[Tensor], tuple[Tensor, Tensor, Tensor]] = _WithMoments.apply
