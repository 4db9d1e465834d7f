# SPDX-License-Identifier: Apache-2.0
"""Farthest point sampling, which gives all clouds of the library their order.

Point k+1 is the one farthest from points 1..k, so the first n points of a sampled cloud are its sample of n points
(Eldar et al. 1997; docs/adr/0002-farthest-point-order.md). Distances are squared, in float32.

The first point is the one farthest from an anchor that lies one bounding-box diagonal below and behind the cloud
(`minimum - diagonal` on every axis). It depends on the points, not on their order in the file. From the second
point on, the anchor is farther from all points than the cloud is wide, so it has no influence.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from doorstate.types import Indices, Points

try:
    import fpsample
except ImportError:  # optional: it ships as source and needs a C++ compiler (docs/adr/0002)
    fpsample = None

HAS_FPSAMPLE = fpsample is not None

_POINTS_PER_LEAF = 2048  # of the k-d tree; fastest for fpsample at 300,000 points
_POINTS_PER_BUCKET = 256  # of the NumPy version; fastest there


def farthest_point_indices(points: Points, count: int) -> Indices:
    """Return the indices of `count` points in farthest-point order, exact.

    Args:
        points: (N, 3) float32 metres, finite, N >= count >= 1.
        count: number of points to choose.

    Returns:
        (count,) int64. Distinct points give distinct indices; when all are taken, the first is repeated.

    Raises:
        ValueError: wrong shape, not finite, or fewer than `count` points.
    """
    points = np.ascontiguousarray(points, dtype=np.float32)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"points must be (N, 3), not {points.shape}")
    if not 1 <= count <= len(points):
        raise ValueError(f"cannot choose {count} of {len(points)} points")
    if not np.isfinite(points).all():
        raise ValueError("points must be finite: drop NaN rows")
    lowest = points.min(axis=0)
    diagonal = np.float32(np.linalg.norm(points.max(axis=0) - lowest) + 1.0)
    with_anchor = np.concatenate([(lowest - diagonal)[None], points])
    height = max(1, int(np.log2(len(with_anchor) / _POINTS_PER_LEAF)))
    choose = bucket_farthest_points if fpsample is None or len(with_anchor) < 4 else _fpsample_farthest_points
    indices = choose(with_anchor, count + 1, height)[1:] - 1
    # Once all distinct points are taken, all distances are 0 and the anchor, as -1, is chosen again.
    indices[indices < 0] = indices[0]
    return indices


def _fpsample_farthest_points(points: Points, count: int, height: int) -> Indices:
    # fpsample 1.0 applies `start_idx` after its tree has reordered the points. The anchor is lowest on every axis and
    # stays in row 0 through every split, so row 0 is the start.
    chosen: NDArray[np.uint64] = fpsample.bucket_fps_kdline_sampling(points, count, h=height, start_idx=0)
    return chosen.astype(np.int64)


def bucket_farthest_points(points: Points, count: int, height: int) -> Indices:
    """Farthest point sampling from row 0 in NumPy, with exactly the result of fpsample.

    Distances are updated only in buckets that a new point can change, as in QuickFPS (Han et al. 2023): a bucket whose
    box is farther from the new point than its own farthest remaining point keeps all its distances.

    Args:
        points: (N, 3) float32, starting with row 0.
        count: number of rows to choose, with the start.
        height: height of the k-d tree that breaks ties.
    """
    tree_order = _tree_order(points, height)
    num_buckets = max(1, len(points) // _POINTS_PER_BUCKET)
    rank = _buckets(points[tree_order], num_buckets)  # (buckets, m), -1 = padding
    padding = rank < 0
    grouped = points[tree_order[rank]]  # (buckets, m, 3)
    low = np.where(padding[..., None], np.inf, grouped).min(axis=1)
    high = np.where(padding[..., None], -np.inf, grouped).max(axis=1)
    distance = np.where(padding, np.float32(-1), np.float32(np.inf))
    farthest = distance.max(axis=1)

    chosen = np.zeros(count, dtype=np.int64)
    for step in range(1, count):
        latest = points[chosen[step - 1]]
        gap = np.maximum(np.maximum(low - latest, latest - high), 0)
        touched = np.flatnonzero((gap * gap).sum(axis=1) < farthest)
        closer = np.minimum(distance[touched], _squared_distance(grouped[touched], latest))
        distance[touched] = closer
        farthest[touched] = closer.max(axis=1)
        largest = farthest.max()
        tied = np.flatnonzero(farthest == largest)
        first = rank[tied, (distance[tied] == largest).argmax(axis=1)].min()
        chosen[step] = tree_order[first]
    return chosen


def _squared_distance(points: Points, origin: Points) -> NDArray[np.float32]:
    x = points[..., 0] - origin[0]
    y = points[..., 1] - origin[1]
    z = points[..., 2] - origin[2]
    squared: NDArray[np.float32] = x * x + y * y + z * z
    return squared


def _tree_order(points: Points, height: int) -> Indices:
    """Return row numbers in the leaf order of a k-d tree that splits at the mean of the longest side, as fpsample."""
    leaves = [np.arange(len(points))]
    for _ in range(height):
        halves: list[Indices] = []
        for leaf in leaves:
            halves += _split_at_mean(points, leaf) if len(leaf) > 1 else [leaf]
        leaves = halves
    return np.concatenate(leaves)


def _split_at_mean(points: Points, leaf: Indices) -> list[Indices]:
    values = points[leaf]
    axis = int((values.max(axis=0) - values.min(axis=0)).argmax())
    # A running float32 sum, not NumPy's pairwise one, to split at the same place as fpsample.
    mean = np.cumsum(values[:, axis], dtype=np.float32)[-1] / np.float32(len(leaf))
    upper = values[:, axis] >= mean
    middle = len(leaf) - int(np.count_nonzero(upper))
    # Hoare's partition swaps the k-th misplaced row from the left with the k-th misplaced row from the right.
    misplaced_left = np.flatnonzero(upper[:middle])
    misplaced_right = middle + np.flatnonzero(~upper[middle:])[::-1]
    leaf = leaf.copy()
    leaf[misplaced_left], leaf[misplaced_right] = leaf[misplaced_right], leaf[misplaced_left]
    middle = min(max(middle, 1), len(leaf) - 1)
    return [leaf[:middle], leaf[middle:]]


def _buckets(points: Points, count: int) -> Indices:
    """Return row numbers (groups, m) in compact groups of nearly equal size, ascending within each; -1 = padding."""
    groups = [np.arange(len(points))]
    while len(groups) < count:
        halves: list[Indices] = []
        for group in groups:
            axis = int(np.ptp(points[group], axis=0).argmax())
            middle = len(group) // 2
            split = np.argpartition(points[group, axis], middle)
            halves += [np.sort(group[split[:middle]]), np.sort(group[split[middle:]])]
        groups = halves
    order = np.full((len(groups), max(len(group) for group in groups)), -1, dtype=np.int64)
    for row, group in zip(order, groups, strict=True):
        row[: len(group)] = group
    return order
