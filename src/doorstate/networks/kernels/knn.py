# SPDX-License-Identifier: Apache-2.0
"""Nearest neighbours, by all distances or by those between blocks of points that can matter.

Both are exact. Coordinates keep full precision under autocast; no gradient flows through a choice.
"""

from __future__ import annotations

import torch
from torch import Tensor

from doorstate.networks.kernels.distances import coordinate_distances, feature_distances
from doorstate.networks.kernels.gather import gather_rows
from doorstate.networks.kernels.knn_blocks import nearest_in_blocks
from doorstate.networks.kernels.pieces import on_cpu, pieces
from doorstate.networks.kernels.precision import at_least_float32, full_precision
from doorstate.networks.kernels.spatial_order import BLOCK_SIZES, block_size, spatial_order

_FEWEST_POINTS = 1024  # below, all distances are cheaper than choosing which to compute


def knn(query: Tensor, points: Tensor, k: int, *, in_order: bool = False) -> Tensor:
    """Return the nearest neighbours, nearest first.

    A query that equals the point of the same index is that point and comes first, before its duplicates: networks
    query a prefix of the points, or points that begin with them.

    Args:
        query: (B, M, D).
        points: (B, N, D).
        k: number of neighbours; at most N are returned.
        in_order: the points are in `spatial_order`, of themselves or of the points that they were computed from. Only
            the time depends on it.

    Returns:
        (B, M, min(k, N)) int64 indices into points.
    """
    k = k if points.shape[1] >= k else points.shape[1]  # `min` would be an operation of an exported graph
    with full_precision(points):
        query, points = at_least_float32(query.detach()), at_least_float32(points.detach())
        if not _blocks_are_faster(query, points, k):
            return _nearest_of_all(query, points, k)
        indices = torch.arange(points.shape[1], device=points.device).expand(len(points), -1)
        if in_order:
            return nearest_in_blocks(query, points, indices, k)
        order = spatial_order(points)
        neighbours = nearest_in_blocks(gather_rows(query, order), gather_rows(points, order), order, k)
        return torch.empty_like(neighbours).scatter_(1, order.unsqueeze(-1).expand_as(neighbours), neighbours)


def _blocks_are_faster(query: Tensor, points: Tensor, k: int) -> bool:
    return (
        not torch.compiler.is_exporting()  # how many distances are needed depends on the points
        and on_cpu(points)
        and points.dtype == torch.float32
        and points.shape[1] >= max(_FEWEST_POINTS, 8 * k)
        and query.shape == points.shape
        and block_size(points.shape[1]) in BLOCK_SIZES
    )


def _nearest_of_all(query: Tensor, points: Tensor, k: int) -> Tensor:
    """Search by all distances: of coordinates by exact differences, of features by a matrix product."""
    squared_distances = coordinate_distances if points.shape[2] == 3 else feature_distances
    num_queries, num_points = query.shape[1], points.shape[1]
    # A graph would hold the operations of every piece.
    exporting = torch.compiler.is_exporting()
    by_topk = exporting or on_cpu(points)
    values_each = num_points if by_topk else len(points) * num_points
    neighbours = []
    for piece in [slice(0, num_queries)] if exporting else pieces(num_queries, values_each, points):
        queries = query[:, piece]
        distances = squared_distances(queries, points)  # (B, m, N)
        twins = points[:, piece]  # fewer than the queries, or none, if there are more queries than points
        same = (queries[:, : twins.shape[1]] == twins).all(-1, keepdim=True)  # (B, m, 1)
        same_index = torch.arange(piece.start, piece.start + twins.shape[1], device=points.device)  # (m,)
        column = same_index.view(1, -1, 1).expand_as(same)
        with_twin = distances[:, : twins.shape[1]]
        with_twin.scatter_(2, column, torch.where(same, -torch.inf, with_twin.gather(2, column)))
        neighbours.append(distances.topk(k, largest=False).indices if by_topk else _smallest(distances, k))
    return torch.cat(neighbours, dim=1)


def _smallest(distances: Tensor, k: int) -> Tensor:
    """Return the (B, m, k) indices of the smallest distances, ties by index: `topk` leaves their order open."""
    if distances.dtype != torch.float32:
        return distances.sort(dim=2, stable=True).indices[..., :k]
    bits = distances.view(torch.int32)
    # Bits of positive floats sort as the floats do, those of negative ones in reverse.
    keys = torch.where(bits < 0, bits ^ 0x7FFFFFFF, bits).long().bitwise_left_shift_(32)
    keys.bitwise_or_(torch.arange(keys.shape[2], device=keys.device))
    return keys.topk(k, largest=False).values.bitwise_and_(2**32 - 1)
