# SPDX-License-Identifier: Apache-2.0
"""Neighbourhoods of points: gathering rows, nearest neighbours, balls.

Coordinates stay in full precision even under autocast; no gradient flows through a choice of neighbours.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, nullcontext
from typing import Literal

import torch
from torch import Tensor
from torch.nn import functional

_DISTANCES_PER_BLOCK = 2**19  # per cloud: 2 MiB of float32 stay in a core's cache


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
    (all networks query a prefix of the points).

    Args:
        query: (B, M, D), M <= N.
        points: (B, N, D).
        k: number of neighbours; at most N are returned.

    Returns:
        (B, M, min(k, N)) int64 indices into points.
    """
    k = min(k, points.shape[1])
    found = []
    with full_precision(points):
        for start, block, distances in _distance_blocks(query, points):
            same_index = torch.arange(start, start + block.shape[1], device=points.device)  # (m,)
            same = (block == points[:, start : start + block.shape[1]]).all(-1, keepdim=True)  # (B, m, 1)
            column = same_index.view(1, -1, 1).expand_as(same)
            own = torch.where(same, -torch.inf, distances.gather(2, column))
            found.append(distances.scatter_(2, column, own).topk(k, largest=False).indices)
    return torch.cat(found, dim=1)


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
    num_points = points.shape[1]
    # Indices as float32 (exact up to 2^24): topk on floats is twice as fast as on integers.
    index = torch.arange(num_points, device=points.device, dtype=torch.float32)
    k = min(num_samples, num_points)
    found = []
    for _, _, squared in _distance_blocks(centres, points):
        hits = torch.where(squared < radius**2, index, float(num_points))
        found.append(hits.topk(k, largest=False).values)
    hits = torch.cat(found, dim=1).long()  # (B, M, k), num_points where there are no more
    first = hits[..., :1]
    hits = torch.where(hits < num_points, hits, first)
    return torch.cat([hits, first.expand(-1, -1, num_samples - k)], dim=-1)


def _distance_blocks(query: Tensor, points: Tensor) -> Iterator[tuple[int, Tensor, Tensor]]:
    """Runs of queries: index of the first, (B, m, D) queries, (B, m, N) squared distances to all points.

    Of coordinates by exact differences; of feature vectors by a matrix product.
    """
    query, points = at_least_float32(query.detach()), at_least_float32(points.detach())
    block_size = max(1, _DISTANCES_PER_BLOCK // points.shape[1])
    distances = _coordinate_distances if points.shape[2] == 3 else _feature_distances
    for start in range(0, query.shape[1], block_size):
        block = query[:, start : start + block_size]
        yield start, block, distances(block, points)


def _coordinate_distances(query: Tensor, points: Tensor) -> Tensor:
    """(B, M, N) squared distances, exactly zero for equal points."""
    columns = points.mT.contiguous()  # (B, 3, N)
    squared = (query[..., :1] - columns[:, :1]).square_()
    for axis in (1, 2):
        difference = query[..., axis : axis + 1] - columns[:, axis : axis + 1]
        squared.addcmul_(difference, difference)
    return squared


def _feature_distances(query: Tensor, points: Tensor) -> Tensor:
    """(B, M, N) squared distances up to a constant per query, which leaves the order of the points."""
    origin = points.mean(dim=1, keepdim=True)  # far from the origin, squares lose the digits that matter
    points = points - origin
    squared_norms = points.square().sum(-1).unsqueeze(1)  # (B, 1, N)
    return torch.baddbmm(squared_norms, query - origin, points.mT, alpha=-2)
