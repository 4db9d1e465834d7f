# SPDX-License-Identifier: Apache-2.0
"""Thinning before farthest point sampling: sampling takes time in proportion to the points it chooses from.

An organized cloud keeps every second, third, ... row and column. A flat cloud keeps one point of each occupied cell of
a grid. Which points stay depends on the points alone, and not on the library that samples them afterwards.
"""

from __future__ import annotations

import numpy as np

from doorstate.types import Indices, Points

PIXELS_PER_POINT = 16  # least number of pixels of an organized cloud for each sampled point
CELLS_PER_POINT = 8  # least number of occupied cells of a flat cloud for each sampled point
_BITS = 17  # of each coordinate: 10 m in steps of 0.1 mm; three of them fit exactly into a float64
_SPREAD = (
    (32, 0x001F00000000FFFF),
    (16, 0x001F0000FF0000FF),
    (8, 0x100F00F00F00F00F),
    (4, 0x10C30C30C30C30C3),
    (2, 0x1249249249249249),
)


def thinned_pixels(height: int, width: int, min_points: int) -> Indices:
    """Return the rows, in the flattened image, of the pixels in every k-th row and column, at least `min_points`."""
    step = max(1, int(np.sqrt(height * width / min_points)))
    return (np.arange(0, height, step)[:, None] * width + np.arange(0, width, step)).ravel()


def thinned_points(points: Points, min_points: int) -> Indices:
    """Return the rows, ascending, of one point in each occupied cell of the coarsest grid that leaves enough.

    The grid divides the bounding cube of the cloud, halved along x, y and z in turn until at least `min_points`
    cells are occupied. A cell keeps its first point on a Z-order curve (Morton 1966), and of points
    closer together than 1 / 131,072 of the cube the one with the lowest row.

    Args:
        points: (N, 3) metres, finite.
        min_points: least number of points to keep; with fewer distinct points, all rows are returned.
    """
    if len(points) <= min_points:
        return np.arange(len(points))
    codes = _morton_codes(points)
    by_code = codes.argsort()
    codes = codes[by_code]
    # Neighbours on the curve lie in the same cell of a grid halved b times if their codes share the first b bits.
    shared = 3 * _BITS - np.frexp((codes[1:] ^ codes[:-1]).astype(np.float64))[1]
    cells = 1 + np.cumsum(np.bincount(shared, minlength=3 * _BITS + 1)[: 3 * _BITS])  # of b = 1, 2, ...
    if cells[-1] < min_points:
        return np.arange(len(points))
    halvings = 1 + int(np.argmax(cells >= min_points))
    distinct = np.flatnonzero(np.concatenate([[True], shared < 3 * _BITS]))
    starts_cell = np.concatenate([[True], shared < halvings])[distinct]
    return np.sort(np.minimum.reduceat(by_code, distinct)[starts_cell])


def _morton_codes(points: Points) -> Indices:
    """Return the place (N,) of each point on a Z-order curve through the bounding cube."""
    lowest = points.min(axis=0).astype(np.float64)
    side = float((points.max(axis=0) - lowest).max())
    scale = 0.0 if side == 0 else 2**_BITS / side
    spread = _spread_bits(np.arange(2**_BITS))
    codes = np.zeros(len(points), np.int64)
    for axis in range(3):
        steps = ((points[:, axis] - lowest[axis]) * scale).astype(np.int64)
        codes |= spread[np.minimum(steps, 2**_BITS - 1)] << (2 - axis)
    return codes


def _spread_bits(values: Indices) -> Indices:
    """Put two zero bits between the bits of integers of at most 21 bits."""
    for shift, mask in _SPREAD:
        values = (values | values << shift) & mask
    return values
