# SPDX-License-Identifier: Apache-2.0
"""Which points are neighbours: the k nearest of each query, and balls around centres.

Both are exact. Coordinates stay in full precision even under autocast; no gradient flows through a choice.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil

import torch
from torch import Tensor

from doorstate.networks.kernels.ops import at_least_float32, full_precision, gather_rows

_DISTANCES_PER_BLOCK = 2**19  # 2 MiB of float32 stay in a core's cache
_BLOCK_SIZES = range(12, 24)
_FEWEST_POINTS = 1024  # below, all distances are cheaper than choosing which to compute
_ROUNDING = 1e-5  # of squared float32 distances, relative to the largest squared norm; ten times what is seen
_POINTS_AT_ONCE = 512  # of a ball query: most balls are full after few points
_FAR, _NOBODY = 1e30, 2**31 - 1


def spatial_order(points: Tensor) -> Tensor:
    """Order in which every run of points lies together: the leaves of a k-d tree with equal halves, in turn.

    Only time depends on it. An exported graph has the order as it is, since there all distances are taken.

    Args:
        points: (B, N, D).

    Returns:
        (B, N) int64 permutation of each cloud.
    """
    batch, num_points, dimensions = points.shape
    order = torch.arange(num_points, device=points.device).expand(batch, -1)
    if torch.compiler.is_exporting():
        return order
    size, smallest = num_points, _block_size(num_points)
    while size > smallest:
        cells = points.reshape(-1, size, dimensions)
        widest = (cells.amax(1) - cells.amin(1)).argmax(-1).view(-1, 1, 1)
        along = cells.gather(2, widest.expand(-1, size, 1)).squeeze(2).argsort(dim=1)  # (cells, size)
        order = order.reshape(-1, size).gather(1, along).view(batch, -1)
        points = gather_rows(cells, along)
        size //= 2
    return order


def knn(query: Tensor, points: Tensor, k: int, *, in_order: bool = False) -> Tensor:
    """Nearest neighbours, nearest first.

    A query equal to the point of the same index is that point: it comes first, whatever duplicates it has
    (networks query a prefix of the points, or points of which the first are these).

    Args:
        query: (B, M, D).
        points: (B, N, D).
        k: number of neighbours; at most N are returned.
        in_order: points come in `spatial_order` already, of themselves or of what they were computed from.
            Only the time depends on it.

    Returns:
        (B, M, min(k, N)) int64 indices into points.
    """
    k = min(k, points.shape[1])
    with full_precision(points):
        query, points = at_least_float32(query.detach()), at_least_float32(points.detach())
        if not _blocks_pay(query, points, k):
            return _nearest_of_all(query, points, k)
        names = torch.arange(points.shape[1], device=points.device).expand(len(points), -1)
        if in_order:
            return _nearest_in_blocks(query, points, names, k)
        order = spatial_order(points)
        found = _nearest_in_blocks(gather_rows(query, order), gather_rows(points, order), order, k)
        return torch.empty_like(found).scatter_(1, order.unsqueeze(-1).expand_as(found), found)


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
    centres, points = at_least_float32(centres.detach()), at_least_float32(points.detach())
    with full_precision(points):
        if torch.compiler.is_exporting():
            return _first_hits_of_all(centres, points, radius, num_samples)
        clouds = zip(centres, points, strict=True)
        return torch.stack([_first_hits(*cloud, radius, num_samples) for cloud in clouds])


def _first_hits(centres: Tensor, points: Tensor, radius: float, num_samples: int) -> Tensor:
    """`ball_query` of one cloud, which leaves a centre alone as soon as its slots are full."""
    slots = torch.arange(num_samples, device=points.device)
    found = slots.new_zeros(len(centres) * num_samples)
    count = slots.new_zeros(len(centres))
    open_centres = torch.arange(len(centres), device=points.device)
    for start in range(0, len(points), _POINTS_AT_ONCE):
        some = points[None, start : start + _POINTS_AT_ONCE]
        squared = _coordinate_distances(centres[None].index_select(1, open_centres), some)[0]
        row, column = (squared < radius**2).nonzero(as_tuple=True)  # by row, then by column
        hits = row.bincount(minlength=len(open_centres))
        first = hits.cumsum(0) - hits - count.index_select(0, open_centres)
        slot = torch.arange(len(row), device=row.device) - first.index_select(0, row)
        kept = (slot < num_samples).nonzero().squeeze(1)
        place = open_centres.index_select(0, row[kept]) * num_samples + slot[kept]
        found.index_copy_(0, place, column[kept] + start)
        count.index_add_(0, open_centres, hits)
        open_centres = (count < num_samples).nonzero().squeeze(1)
        if not len(open_centres):
            break
    found = found.view(-1, num_samples)
    return torch.where(slots < count.unsqueeze(1), found, found[:, :1])


def _first_hits_of_all(centres: Tensor, points: Tensor, radius: float, num_samples: int) -> Tensor:
    """`ball_query` as one graph, whose shapes do not depend on the points."""
    num_points = points.shape[1]
    k = min(num_samples, num_points)
    hits = _coordinate_distances(centres, points) < radius**2
    index = torch.where(hits, torch.arange(num_points, device=points.device), num_points)
    index = index.topk(k, largest=False).values  # (B, M, k), num_points where there are no more
    first = index[..., :1]
    index = torch.where(index < num_points, index, first)
    return torch.cat([index, first.expand(-1, -1, num_samples - k)], dim=-1)


def _nearest_of_all(query: Tensor, points: Tensor, k: int) -> Tensor:
    """Nearest neighbours by all distances: of coordinates by exact differences, of features by a matrix product."""
    find_distances = _coordinate_distances if points.shape[2] == 3 else _feature_distances
    block_size = max(1, _DISTANCES_PER_BLOCK // points.shape[1])
    if torch.compiler.is_exporting():  # a graph would hold every block's operations
        block_size = query.shape[1]
    found = []
    for start in range(0, query.shape[1], block_size):
        block = query[:, start : start + block_size]
        distances = find_distances(block, points)  # (B, m, N)
        twins = points[
            :, start : start + block.shape[1]
        ]  # fewer, or none, where there are more queries than points
        same = (block[:, : twins.shape[1]] == twins).all(-1, keepdim=True)  # (B, m, 1)
        same_index = torch.arange(start, start + twins.shape[1], device=points.device)  # (m,)
        column = same_index.view(1, -1, 1).expand_as(same)
        with_twin = distances[:, : twins.shape[1]]
        with_twin.scatter_(2, column, torch.where(same, -torch.inf, with_twin.gather(2, column)))
        found.append(distances.topk(k, largest=False).indices)
    return torch.cat(found, dim=1)


def _block_size(count: int) -> int:
    while count % 2 == 0 and count not in _BLOCK_SIZES:
        count //= 2
    return count


def _blocks_pay(query: Tensor, points: Tensor, k: int) -> bool:
    return (
        points.dtype == torch.float32
        and points.shape[1] >= max(_FEWEST_POINTS, 8 * k)
        and query.shape == points.shape
        and _block_size(points.shape[1]) in _BLOCK_SIZES
        and not torch.compiler.is_exporting()  # how many distances are needed depends on the points
    )


def _nearest_in_blocks(query: Tensor, points: Tensor, names: Tensor, k: int) -> Tensor:
    """Nearest neighbours of runs of points among those runs of points that can hold any.

    A run of points has a centre and a radius. By the triangle inequality it can be left out for a query whose
    distance to the centre, less the radius, exceeds what k points closer by are known to be within.

    Args:
        query: (B, N, D).
        points: (B, N, D).
        names: (B, N) what each point is called in the result.
        k: number of neighbours.

    Returns:
        (B, N, k) names, by distance and then by name; first the point that a query is.
    """
    batch, _, dimensions = points.shape
    size = _block_size(points.shape[1])
    itself = (query == points).all(-1).view(-1, size, 1)
    origin = points.mean(dim=1, keepdim=True)  # far from the origin, squares lose the digits that matter
    query, points = query - origin, points - origin
    blocks = points.view(batch, -1, size, dimensions)  # (B, P, p, D)
    num_blocks = blocks.shape[1]
    centres = blocks.mean(2)  # (B, P, D)
    radii = (blocks - centres.unsqueeze(2)).square().sum(-1).amax(2).sqrt()  # (B, P)
    slack = _ROUNDING * points.square().sum(-1).amax(1).view(batch, 1, 1)  # (B, 1, 1)

    left, right = _factors(query.view_as(blocks), blocks)
    left, right = left.flatten(0, 1), right.flatten(0, 1)  # (B * P, p, D + 2)
    # One more block, far away, fills lists of blocks that are shorter than others.
    far = right.new_zeros(1, size, dimensions + 2)
    far[..., -1] = _FAR
    right = torch.cat([right, far])
    labels = torch.cat([names.reshape(-1, size), names.new_full((1, size), _NOBODY)])
    first_block = num_blocks * torch.arange(batch, device=points.device).view(-1, 1, 1)

    def distances(chosen: Tensor, lists: Tensor) -> Tensor:
        """(g, p, n * p) squared distances of chosen runs to the blocks in their lists (g, n)."""
        candidates = right.index_select(0, lists.flatten()).view(len(lists), -1, dimensions + 2)
        return torch.bmm(left.index_select(0, chosen), candidates.mT).clamp_min_(torch.finfo(left.dtype).tiny)

    near = torch.cdist(centres, centres).topk(ceil(1.5 * k / size), largest=False).indices
    every = torch.arange(len(left), device=points.device)
    bound = distances(every, (near + first_block).flatten(0, 1)).kthvalue(k).values.view(batch, -1, 1)
    reach = (bound + slack).sqrt() + radii.unsqueeze(1)  # (B, N, P)
    to_centre = torch.bmm(*_factors(query, centres, transpose=True)) - slack
    needed = (to_centre <= reach.square_()).view(batch, num_blocks, size, num_blocks).any(2)  # (B, P, P)
    needed.diagonal(dim1=1, dim2=2).fill_(True)

    count, order = needed.sum(2).flatten().sort()
    lists = needed.byte().argsort(dim=2, descending=True, stable=True)
    lists = torch.where(needed.gather(2, lists), lists + first_block, len(right) - 1).flatten(0, 1)
    before = needed.cumsum(2).diagonal(dim1=1, dim2=2).reshape(-1, 1, 1) - 1  # blocks listed before one's own
    own = before * size + torch.arange(size, device=points.device).view(1, -1, 1)  # (B * P, p, 1) its column
    found = names.new_empty(len(left), size, k)
    for chosen, width in _chunks(order, count, size * size):
        shortened = lists.index_select(0, chosen)[:, :width]
        squared = distances(chosen, shortened)
        column = own.index_select(0, chosen)
        squared.scatter_(2, column, squared.gather(2, column).masked_fill_(itself.index_select(0, chosen), 0))
        # Bits of positive floats sort as the floats do; the name below them settles ties.
        keys = squared.view(torch.int32).long().bitwise_left_shift_(32)
        keys.bitwise_or_(labels.index_select(0, shortened.flatten()).view(len(chosen), 1, -1))
        found[chosen] = keys.topk(k, largest=False).values.bitwise_and_(2**32 - 1)
    return found.view(batch, -1, k)


def _factors(query: Tensor, points: Tensor, transpose: bool = False) -> tuple[Tensor, Tensor]:
    """Factors (..., D + 2) whose rows' inner products are squared distances."""
    one, square = query.new_ones(1), points.square().sum(-1, keepdim=True)
    left = torch.cat([-2 * query, query.square().sum(-1, keepdim=True), one.expand_as(query[..., :1])], -1)
    right = torch.cat([points, one.expand_as(square), square], -1)
    return left, right.mT if transpose else right


def _chunks(order: Tensor, count: Tensor, pairs: int) -> Iterator[tuple[Tensor, int]]:
    """Runs whose lists are alike in length, as many as fit the cache, with the longest list's length."""
    counts = count.tolist()
    stop = len(counts)
    while stop > 0:
        width = counts[stop - 1]
        start = max(0, stop - max(1, _DISTANCES_PER_BLOCK // (width * pairs)))
        yield order[start:stop], width
        stop = start


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
