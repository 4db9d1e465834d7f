# SPDX-License-Identifier: Apache-2.0
"""Operations on rows that torch has no quick form of: gathers, sums and maxima, each with its own gradient.

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
    rows = flat_rows(values, indices).reshape(-1)
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
    if not wants_gradient(values):
        return _neighbour_amax(values, indices)
    return _max_neighbours(values, indices)


def weigh_neighbours(rows: Tensor, weight: Tensor) -> Tensor:
    """Sum over the neighbours of each channel: (B, P, m, C) of (B, P, K, C) rows and (K, C, m) weights.

    One pass over the rows in their order; as a product per channel it would transpose them first.
    """
    if torch.compiler.is_exporting():
        return torch.einsum("bpkc,kcm->bpmc", rows, weight)
    return _weigh_neighbours(rows, weight)


def max_over_points(values: Tensor) -> Tensor:
    """Maximum over the axis before the last; its gradient goes to the first point that has it."""
    if torch.compiler.is_exporting() or not wants_gradient(values):
        return values.amax(-2)
    return _max_points(values)


def _is_autocast(tensor: Tensor) -> bool:
    device = tensor.device.type
    return torch.amp.is_autocast_available(device) and torch.is_autocast_enabled(device)


def wants_gradient(*tensors: Tensor) -> bool:
    """Whether autograd will want a gradient of any of them."""
    return torch.is_grad_enabled() and any(tensor.requires_grad for tensor in tensors)


def flat_rows(values: Tensor, indices: Tensor) -> Tensor:
    """Row numbers in the flattened batch: (B, ...) like the indices."""
    batch, num_rows, _ = values.shape
    first_row = num_rows * torch.arange(batch, device=values.device)
    return indices + first_row.view(-1, *[1] * (indices.dim() - 1))


def pieces(count: int, values_each: int) -> Iterator[slice]:
    """Runs of `count` items of so many values that stay in a core's cache."""
    size = max(1, _VALUES_PER_PIECE // values_each)
    return (slice(start, min(start + size, count)) for start in range(0, count, size))


def first_winner(values: Tensor) -> tuple[Tensor, Tensor]:
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


def put_along(values: Tensor, places: Tensor, new: Tensor) -> None:
    """Scatter along axis 1; as integers, because torch scatters bfloat16 four times as slowly."""
    bits = _BITS[values.element_size()]
    values.view(bits).scatter_(1, places, new.view(bits))


def _neighbour_amax(values: Tensor, indices: Tensor) -> Tensor:
    batch, num_queries, k = indices.shape
    flat, rows = values.flatten(0, 1), flat_rows(values, indices).flatten(0, 1)  # (B * N, C), (B * M, k)
    out = flat.new_empty(len(rows), flat.shape[1])
    for piece in pieces(len(rows), k * flat.shape[1]):
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
        for piece in pieces(len(rows), k * channels):
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
        """The same sum on the reversed graph: over the queries that have a point as a neighbour."""
        (bags,) = ctx.saved_tensors
        num_points = ctx.shape[0] * ctx.shape[1]
        points, edges = bags.flatten().sort()
        first = torch.searchsorted(points, torch.arange(num_points, device=grad.device))
        queries = edges // bags.shape[1]
        spread = functional.embedding_bag(queries, grad.flatten(0, 1).contiguous(), first, mode="sum")
        return spread.view(ctx.shape), None


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
        grads = [each.contiguous() for each in at_least_float32(grad.flatten(0, 1)).unbind(1)]
        of_rows, of_weight = torch.empty_like(flat), torch.empty_like(weight)
        product = torch.empty_like(grads[0])
        for slot, weights in enumerate(weight):
            row = at_least_float32(flat[:, slot])
            for multiple, each in enumerate(grads):
                of_weight[slot, :, multiple] = torch.mul(each, row, out=product).sum(0)
            product.zero_()
            for column, each in zip(weights.unbind(1), grads, strict=True):
                product.addcmul_(each, column)
            of_rows[:, slot] = product
        return of_rows.view_as(rows), of_weight


class _MaxOverPoints(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, values: Tensor) -> Tensor:
        groups = values.flatten(0, -3)  # (G, K, C)
        out = groups.new_empty(len(groups), groups.shape[2])
        winners = torch.empty(out.shape, dtype=torch.int64, device=values.device)
        for piece in pieces(len(groups), groups[0].numel()):
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


_sum_neighbours: Callable[[Tensor, Tensor], Tensor] = _NeighbourSum.apply
_max_neighbours: Callable[[Tensor, Tensor], Tensor] = _NeighbourMax.apply
_weigh_neighbours: Callable[[Tensor, Tensor], Tensor] = _WeighNeighbours.apply
_max_points: Callable[[Tensor], Tensor] = _MaxOverPoints.apply
