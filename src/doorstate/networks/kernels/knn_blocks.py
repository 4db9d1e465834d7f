# SPDX-License-Identifier: Apache-2.0
"""Nearest neighbours among the blocks of points that can hold any.

Points in spatial order form blocks of p points, each with a centre c and a radius r. k points near a query q bound
the distance to its k-th neighbour by b. By the triangle inequality every point x of a block has

    |q - x| >= |q - c| - r,

so a block with |q - c| - r > b holds no neighbour and is left out. A slack covers the rounding of squared distances.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil

import torch
from torch import Tensor

from doorstate.networks.kernels.pieces import VALUES_PER_PIECE
from doorstate.networks.kernels.spatial_order import block_size

_ROUNDING = 1e-5  # of squared float32 distances, relative to the largest squared norm; ten times what is seen
_FAR, _NO_LABEL = 1e30, 2**31 - 1


def nearest_in_blocks(query: Tensor, points: Tensor, labels: Tensor, k: int) -> Tensor:
    """Return the nearest neighbours of points in spatial order.

    Args:
        query: (B, N, D).
        points: (B, N, D).
        labels: (B, N) number of each point in the result.
        k: number of neighbours.

    Returns:
        (B, N, k) labels by distance, then by label; the query itself comes first.
    """
    batch, _, dimensions = points.shape
    size = block_size(points.shape[1])
    itself = (query == points).all(-1).view(-1, size, 1)
    origin = points.mean(dim=1, keepdim=True)  # far from the origin, squares lose digits
    query, points = query - origin, points - origin
    blocks = points.view(batch, -1, size, dimensions)  # (B, P, p, D)
    num_blocks = blocks.shape[1]
    centres = blocks.mean(2)  # (B, P, D)
    radii = (blocks - centres.unsqueeze(2)).square().sum(-1).amax(2).sqrt()  # (B, P)
    slack = _ROUNDING * points.square().sum(-1).amax(1).view(batch, 1, 1)  # (B, 1, 1)

    left, right = _factors(query.view_as(blocks), blocks)
    left, right = left.flatten(0, 1), right.flatten(0, 1)  # (B * P, p, D + 2)
    # One more block, far away, pads the lists of blocks to the same length.
    far = right.new_zeros(1, size, dimensions + 2)
    far[..., -1] = _FAR
    right = torch.cat([right, far])
    block_labels = torch.cat([labels.reshape(-1, size), labels.new_full((1, size), _NO_LABEL)])
    first_block = num_blocks * torch.arange(batch, device=points.device).view(-1, 1, 1)

    def distances(chosen: Tensor, lists: Tensor) -> Tensor:
        """Return (g, p, n * p) squared distances of chosen blocks to the blocks in their (g, n) lists."""
        candidates = right.index_select(0, lists.flatten()).view(len(lists), -1, dimensions + 2)
        return torch.bmm(left.index_select(0, chosen), candidates.mT).clamp_min_(torch.finfo(left.dtype).tiny)

    near = torch.cdist(centres, centres).topk(ceil(1.5 * k / size), largest=False).indices
    all_blocks = torch.arange(len(left), device=points.device)
    bound = distances(all_blocks, (near + first_block).flatten(0, 1)).kthvalue(k).values.view(batch, -1, 1)
    reach = (bound + slack).sqrt() + radii.unsqueeze(1)  # (B, N, P)
    to_centre = torch.bmm(*_factors(query, centres, transpose=True)) - slack
    needed = (to_centre <= reach.square_()).view(batch, num_blocks, size, num_blocks).any(2)  # (B, P, P)
    needed.diagonal(dim1=1, dim2=2).fill_(True)

    count, order = needed.sum(2).flatten().sort()
    lists = needed.byte().argsort(dim=2, descending=True, stable=True)
    lists = torch.where(needed.gather(2, lists), lists + first_block, len(right) - 1).flatten(0, 1)
    # Blocks listed before the query's own, and the column of the query itself.
    before = needed.cumsum(2).diagonal(dim1=1, dim2=2).reshape(-1, 1, 1) - 1
    own = before * size + torch.arange(size, device=points.device).view(1, -1, 1)  # (B * P, p, 1)
    neighbours = labels.new_empty(len(left), size, k)
    for chosen, width in _chunks(order, count, size * size):
        shortened = lists.index_select(0, chosen)[:, :width]
        squared = distances(chosen, shortened)
        column = own.index_select(0, chosen)
        squared.scatter_(2, column, squared.gather(2, column).masked_fill_(itself.index_select(0, chosen), 0))
        # Bits of positive floats sort as the floats do; the label below them settles ties.
        keys = squared.view(torch.int32).long().bitwise_left_shift_(32)
        keys.bitwise_or_(block_labels.index_select(0, shortened.flatten()).view(len(chosen), 1, -1))
        neighbours[chosen] = keys.topk(k, largest=False).values.bitwise_and_(2**32 - 1)
    return neighbours.view(batch, -1, k)


def _factors(query: Tensor, points: Tensor, transpose: bool = False) -> tuple[Tensor, Tensor]:
    """Return (..., D + 2) factors whose inner products are squared distances."""
    ones, square = query.new_ones(1), points.square().sum(-1, keepdim=True)
    left = torch.cat([-2 * query, query.square().sum(-1, keepdim=True), ones.expand_as(query[..., :1])], -1)
    right = torch.cat([points, ones.expand_as(square), square], -1)
    return left, right.mT if transpose else right


def _chunks(order: Tensor, count: Tensor, pairs: int) -> Iterator[tuple[Tensor, int]]:
    """Yield blocks with lists of similar length, as many as fit the cache, and the length of the longest list."""
    counts = count.tolist()
    stop = len(counts)
    while stop > 0:
        width = counts[stop - 1]
        start = max(0, stop - max(1, VALUES_PER_PIECE // (width * pairs)))
        yield order[start:stop], width
        stop = start
