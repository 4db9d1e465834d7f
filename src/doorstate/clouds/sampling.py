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

from doorstate.clouds.coordinates import coordinates
from doorstate.clouds.samplers import Sampler, choose_sampler
from doorstate.types import Indices, Points

POINTS_PER_LEAF = 2048  # of the k-d tree; fastest for fpsample at 300,000 points


def farthest_point_indices(
    points: Points, count: int, sampler: Sampler | None = None, points_per_leaf: int = POINTS_PER_LEAF
) -> Indices:
    """Return the indices of `count` points in farthest-point order, exact.

    Args:
        points: (N, 3) float32 metres, finite, N >= count >= 1.
        count: number of points to choose.
        sampler: implementation to use; all give the same indices. None: `choose_sampler()`.
        points_per_leaf: size of the leaves of the k-d tree that is built, which breaks ties and sets the time.

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
    xyz = coordinates(points)
    lowest = xyz.min(axis=1)
    diagonal = np.float32(np.linalg.norm(xyz.max(axis=1) - lowest) + 1.0)
    with_anchor = np.concatenate([(lowest - diagonal)[None], points])
    height = max(1, int(np.log2(len(with_anchor) / points_per_leaf)))
    sampler = sampler or choose_sampler()
    indices = sampler(with_anchor, count + 1, height)[1:] - 1
    # Once all distinct points are taken, all distances are 0 and the anchor, as -1, is chosen again.
    indices[indices < 0] = indices[0]
    return indices
