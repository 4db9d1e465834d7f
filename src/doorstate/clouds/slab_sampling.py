# SPDX-License-Identifier: Apache-2.0
"""Farthest point sampling in NumPy, with exactly the result of fpsample.

A new point at distance r from the chosen ones changes distances only within r of itself. Points are sorted along the
longest side of the cloud, so these lie in one slab, a range of rows. The farthest point of each block of rows is kept.
"""

from __future__ import annotations

import math
import sys
from bisect import bisect_left, bisect_right

import numpy as np

from doorstate.types import Indices, Points

_BLOCK = 256
_FARTHEST = np.int64(np.float32(np.inf).view(np.int32)) << 32
_HIGH_HALF = 1 if sys.byteorder == "little" else 0
# A slab is wider than r by more than all roundings of a squared distance, so no point outside it comes nearer than r.
_WIDER = 1 + 1e-6


def slab_farthest_points(points: Points, count: int, height: int) -> Indices:
    """Return row numbers (count,) int64 in farthest-point order, from row 0.

    Args:
        points: (N, 3) float32.
        count: number of rows to choose, with the start.
        height: height of the k-d tree that breaks ties.
    """
    axes = np.ascontiguousarray(points.T)
    longest = axes[int(np.ptp(axes, axis=1).argmax())]
    sorted_rows: Indices = longest.argsort(kind="stable")
    along: list[float] = longest[sorted_rows].tolist()
    num_blocks = -(-len(points) // _BLOCK)
    padded = num_blocks * _BLOCK
    xyz = np.zeros((3, padded), np.float32)
    xyz[:, : len(points)] = axes.take(sorted_rows, axis=1)
    # One integer orders points by distance, and equal distances by leaf order: the bits of a float32 that is not
    # negative order as integers do, and stand above the bits of N - 1 - rank. Padding is lowest of all.
    keys, keys_now = np.full((2, padded), -1, np.int64)
    keys_now[: len(points)] = len(points) - 1 - leaf_ranks(axes, height)[sorted_rows]
    keys[: len(points)] = keys_now[: len(points)] | _FARTHEST
    squared, squared_now = (array.view(np.float32)[_HIGH_HALF::2] for array in (keys, keys_now))
    blocks = keys.reshape(num_blocks, _BLOCK)
    highest = blocks.max(axis=1)
    difference = np.empty_like(xyz)
    x, y, z = difference

    position, reach = int(sorted_rows.argmin()), math.inf
    chosen = [position]
    for _ in range(1, count):
        first = bisect_left(along, along[position] - reach) // _BLOCK
        last = (bisect_right(along, along[position] + reach) - 1) // _BLOCK + 1
        start, stop = first * _BLOCK, min(last * _BLOCK, len(points))
        slab = difference[:, start:stop]
        np.subtract(xyz[:, start:stop], xyz[:, position, None], out=slab)
        np.multiply(slab, slab, out=slab)
        np.add(x[start:stop], y[start:stop], out=x[start:stop])
        np.add(x[start:stop], z[start:stop], out=squared_now[start:stop])
        np.minimum(keys[start:stop], keys_now[start:stop], out=keys[start:stop])
        np.maximum.reduce(blocks[first:last], axis=1, out=highest[first:last])
        block = int(highest.argmax())
        position = block * _BLOCK + int(blocks[block].argmax())
        reach = math.sqrt(squared[position]) * _WIDER
        chosen.append(position)
    rows: Indices = sorted_rows[chosen]
    return rows


def leaf_ranks(axes: Points, height: int) -> Indices:
    """Return the rank (N,) of each point in the leaves of a k-d tree that splits at the mean of the longest side.

    Args:
        axes: (3, N) coordinates.
        height: number of splits from the root to a leaf.
    """
    leaves = [np.arange(axes.shape[1])]
    for _ in range(height):
        halves: list[Indices] = []
        for leaf in leaves:
            halves += _split_at_mean(axes, leaf) if len(leaf) > 1 else [leaf]
        leaves = halves
    ranks = np.empty(axes.shape[1], dtype=np.int64)
    ranks[np.concatenate(leaves)] = np.arange(len(ranks))
    return ranks


def _split_at_mean(axes: Points, leaf: Indices) -> list[Indices]:
    values = axes.take(leaf, axis=1)
    longest = values[(values.max(axis=1) - values.min(axis=1)).argmax()]
    # A running float32 sum, not NumPy's pairwise one, to split at the same place as fpsample.
    mean = np.cumsum(longest, dtype=np.float32)[-1] / np.float32(len(leaf))
    upper = longest >= mean
    middle = len(leaf) - int(np.count_nonzero(upper))
    # Hoare's partition swaps the k-th misplaced row from the left with the k-th misplaced row from the right.
    misplaced_left = np.flatnonzero(upper[:middle])
    misplaced_right = middle + np.flatnonzero(~upper[middle:])[::-1]
    leaf = leaf.copy()
    leaf[misplaced_left], leaf[misplaced_right] = leaf[misplaced_right], leaf[misplaced_left]
    middle = min(max(middle, 1), len(leaf) - 1)
    return [leaf[:middle], leaf[middle:]]
