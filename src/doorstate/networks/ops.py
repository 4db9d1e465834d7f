# SPDX-License-Identifier: Apache-2.0
"""Neighbourhoods of points: gathering rows, nearest neighbours, balls.

Coordinates stay in full precision even under autocast; no gradient flows through a choice of neighbours.
"""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from typing import Literal

import torch
from torch import Tensor
from torch.nn import functional

_QUERIES_PER_BLOCK = 512  # 8 MiB of distances per cloud of 4096 points: stays in cache


def full_precision(tensor: Tensor) -> AbstractContextManager[object]:
    """Context in which autocast leaves operations on the tensor's device alone."""
    device = tensor.device.type
    return torch.autocast(device, enabled=False) if torch.is_autocast_enabled(device) else nullcontext()


def at_least_float32(values: Tensor) -> Tensor:
    """Values as float32, or float64 if they are that already."""
    return values.to(torch.promote_types(values.dtype, torch.float32))


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


def reduce_neighbours(values: Tensor, indices: Tensor, reduction: Literal["sum", "max"]) -> Tensor:
    """Sum or maximum of each point's neighbours, without a tensor of all neighbours.

    Args:
        values: (B, N, C).
        indices: (B, M, k) int64 row numbers within the same cloud.
        reduction: "sum" or "max"; the gradient of a maximum goes to one neighbour.

    Returns:
        (B, M, C).
    """
    bags = _flat_rows(values, indices).flatten(0, 1)  # (B * M, k)
    reduced = functional.embedding_bag(bags, values.flatten(0, 1), mode=reduction)
    return reduced.view(*indices.shape[:2], values.shape[-1])


def _flat_rows(values: Tensor, indices: Tensor) -> Tensor:
    """Row numbers in the flattened batch: (B, ...) like the indices."""
    batch, num_rows, _ = values.shape
    first_row = num_rows * torch.arange(batch, device=values.device)
    return indices + first_row.view(-1, *[1] * (indices.dim() - 1))


def max_over(values: Tensor, dim: int) -> Tensor:
    """Maximum along one axis; its gradient goes to one arg-max, found only when a gradient is wanted."""
    return values.max(dim).values if values.requires_grad else values.amax(dim)


def knn(query: Tensor, points: Tensor, k: int) -> Tensor:
    """Nearest neighbours, nearest first.

    A query equal to the point of the same index is that point: it comes first, whatever duplicates it has
    (all networks query a prefix of the points). Three coordinates are compared by exact differences, longer
    feature vectors, centred first, by a matrix product.

    Args:
        query: (B, M, D), M <= N.
        points: (B, N, D).
        k: number of neighbours; at most N are returned.

    Returns:
        (B, M, min(k, N)) int64 indices into points.
    """
    query, points = at_least_float32(query.detach()), at_least_float32(points.detach())
    centroid = points.mean(dim=1, keepdim=True)
    query, points = query - centroid, points - centroid
    k = min(k, points.shape[1])
    blocks, start = [], 0
    with full_precision(points):
        for block in torch.split(query, _QUERIES_PER_BLOCK, dim=1):
            distances = _comparable_distances(block, points)  # (B, m, N)
            own = (block == points[:, start : start + block.shape[1]]).all(-1)  # (B, m)
            distances.diagonal(start, dim1=1, dim2=2).masked_fill_(own, -torch.inf)
            blocks.append(distances.topk(k, largest=False).indices)
            start += block.shape[1]
    return torch.cat(blocks, dim=1)


def _comparable_distances(query: Tensor, points: Tensor) -> Tensor:
    """(B, M, N) numbers that order the points by distance to each query."""
    if points.shape[-1] <= 3:
        return torch.cdist(query, points, compute_mode="donot_use_mm_for_euclid_dist")
    squared_norms = points.square().sum(-1).unsqueeze(1)  # (B, 1, N)
    # |q - p|^2 without |q|^2, which does not change the order of the points.
    return torch.baddbmm(squared_norms, query, points.mT, alpha=-2)


def ball_query(centres: Tensor, points: Tensor, radius: float, num_samples: int) -> Tensor:
    """First points, in index order, strictly closer than a radius (PointNet++ grouping).

    Args:
        centres: (B, M, 3), each also one of the points, so that no ball is empty.
        points: (B, N, 3).
        radius: in the unit of the points.
        num_samples: slots per centre; slots left over repeat the first hit.

    Returns:
        (B, M, num_samples) int64 indices into points.
    """
    centres, points = centres.detach(), points.detach()
    num_points = points.shape[1]
    with full_precision(points):
        distances = torch.cdist(centres, points, compute_mode="donot_use_mm_for_euclid_dist")  # (B, M, N)
    # Indices as float32 (exact up to 2^24): topk on floats is twice as fast as on integers.
    index = torch.arange(num_points, device=points.device, dtype=torch.float32)
    hits = torch.where(distances < radius, index, float(num_points))
    hits = hits.topk(min(num_samples, num_points), largest=False).values.long()  # (B, M, k)
    first = hits[..., :1]
    hits = torch.where(hits < num_points, hits, first)
    missing = num_samples - hits.shape[-1]
    return torch.cat([hits, first.expand(-1, -1, missing)], dim=-1) if missing else hits
