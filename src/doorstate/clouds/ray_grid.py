# SPDX-License-Identifier: Apache-2.0
"""Numbers of points near each point of a flat cloud, counted on a grid of directions and ranges.

A grid of rays suits a sensor as it stands: the density of its points per direction does not depend on range.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from doorstate.types import Points

_MIN_CELL = 0.02  # sine between rays: 11 pixels of an image of 640 x 480 with a lens of 60 degrees
_POINTS_PER_CELL = 16  # on average, in thinner clouds
_RANGE_STEP = 0.03  # relative; ranges in adjoining cells differ by 5 % on average
_MAX_RANGE_RATIO = 30.0  # of the median range and its limits; beyond them all ranges are one


def block_counts(points: Points) -> NDArray[np.int32]:
    """Return the number of points in the 3 x 3 x 3 cells about each point, with itself.

    Args:
        points: (N, 3) measured points, sensor frame, N >= 1.
    """
    cells, shape = _cells(points)
    counts = np.bincount(cells, minlength=int(np.prod(shape))).astype(np.int32).reshape(shape)
    for axis in range(3):
        blocks = counts.copy()
        upper = tuple(np.s_[1:] if axis == number else np.s_[:] for number in range(3))
        lower = tuple(np.s_[:-1] if axis == number else np.s_[:] for number in range(3))
        blocks[upper] += counts[lower]
        blocks[lower] += counts[upper]
        counts = blocks
    near: NDArray[np.int32] = counts.ravel()[cells]
    return near


def _cells(points: Points) -> tuple[NDArray[np.int32], tuple[int, int, int]]:
    """Return the number of each point's cell (N,), and the shape of the grid; its outermost cells are empty."""
    x, y, z = (np.asarray(points[:, axis], dtype=np.float32) for axis in range(3))
    range_m = np.sqrt(x * x + y * y + z * z)
    across, up = y / range_m, z / range_m
    if (x < 0).any():
        across = np.where(x < 0, 4 - across, across)  # behind the sensor: cells of their own
    side = max(_MIN_CELL, float(np.sqrt(_POINTS_PER_CELL * np.ptp(across) * np.ptp(up) / len(points))))
    median = float(np.median(range_m[:: max(1, len(range_m) // 4096)]))
    np.clip(range_m, median / _MAX_RANGE_RATIO, median * _MAX_RANGE_RATIO, out=range_m)
    depth = np.log(range_m, out=range_m)
    number = np.zeros(len(points), dtype=np.int32)
    shape = []
    for values, step in ((across, side), (up, side), (depth, float(np.log1p(_RANGE_STEP)))):
        low = values.min()
        place = ((values - low) / np.float32(step)).astype(np.int32)
        shape.append(int(place.max()) + 3)
        number *= shape[-1]
        number += place
        number += 1
    return number, (shape[0], shape[1], shape[2])
