# SPDX-License-Identifier: Apache-2.0
"""Comparison of two clouds of one camera: the share of rays whose range has changed.

Clouds are compared on a coarse grid: an image by some of its rows and columns, a flat cloud by the nearest point of
each cell of directions. A ray counts where both clouds measured it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.measured import is_measured
from doorstate.types import Points

_ROWS, _COLUMNS = 60, 80  # of the grid of an image
_CELL_RAD = math.radians(1.5)  # of the grid of directions
_CHANGED_M, _CHANGED_SHARE = 0.05, 0.02  # of a range: noise of depth cameras at 3 m stays below


class Rays(NamedTuple):
    """Coarse view of a cloud."""

    points_m: NDArray[np.float32]  # (K, 3) nearest or sampled points; NaN where nothing was measured
    range_m: NDArray[np.float32]  # (K,)
    shape: tuple[int, ...]  # of the cloud if it is an image, () if it is flat


def coarse_rays(cloud: Points) -> Rays:
    """Return the coarse view of a cloud, (N, 3) or organized (H, W, 3)."""
    if cloud.ndim == 3:
        down, across = (
            math.ceil(size / most) for size, most in zip(cloud.shape[:2], (_ROWS, _COLUMNS), strict=True)
        )
        points = cloud[down // 2 :: down, across // 2 :: across].reshape(-1, 3).astype(np.float32)
        points[~is_measured(points)] = np.nan
        return Rays(points, np.linalg.norm(points, axis=1), cloud.shape)
    points = cloud[is_measured(cloud)].astype(np.float32)
    range_m = np.linalg.norm(points, axis=1)
    bearing = np.arctan2(points[:, 1], points[:, 0]) + math.pi
    elevation = np.arcsin(np.clip(points[:, 2] / np.maximum(range_m, 1e-6), -1, 1)) + math.pi / 2
    columns, rows = math.ceil(2 * math.pi / _CELL_RAD) + 1, math.ceil(math.pi / _CELL_RAD) + 1
    cell = (elevation / _CELL_RAD).astype(np.int64) * columns + (bearing / _CELL_RAD).astype(np.int64)
    order = np.argsort(range_m)[::-1]  # the nearest point of a cell is written last
    nearest = np.full((rows * columns, 3), np.nan, np.float32)
    nearest[cell[order]] = points[order]
    return Rays(nearest, np.linalg.norm(nearest, axis=1), ())


def changed_rays(before: Rays, after: Rays) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which rays both clouds measured, and which of them have changed; none and none for other sizes."""
    if before.shape != after.shape:
        none = np.zeros(len(before.range_m), bool)
        return none, none
    measured = np.isfinite(before.range_m) & np.isfinite(after.range_m)
    with np.errstate(invalid="ignore"):
        change_m = np.abs(after.range_m - before.range_m)
        changed = change_m > _CHANGED_M + _CHANGED_SHARE * before.range_m
    return measured, measured & changed
