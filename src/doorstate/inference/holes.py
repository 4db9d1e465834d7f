# SPDX-License-Identifier: Apache-2.0
"""Holes in a cloud: columns of the view in which nothing was measured and no floor is visible farther away.

A hole is a run of missing pixels down a column of the image. It is a free way only if below it something was measured
farther away than a door can be: the floor behind an open door. Behind glass, dropout and things before the lens no such
floor is visible.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.types import Points

# Cells of 8 x 8 pixels in a 640 x 480 image: hundredths of a door, tens of pixels to judge by.
_GRID_ROWS, _GRID_COLUMNS = 60, 80
_POINTS_PER_CELL = 16  # on average; a flat cloud with fewer has gaps of its own
# Of the cells; with fewer than 15 x 20 a gap beside a leaf and a hole in it look alike.
_MIN_GRID_SHARE = 1 / 16
_MIN_CELL_SHARE = 1 / 8  # of a cell's pixels; fewer are flying pixels
# Flat clouds are evaluated within 45 degrees of straight ahead: no depth camera sees more.
_MAX_TANGENT = 1.0


class _Cells(NamedTuple):
    """Coarse image of a cloud, the lowest row last."""

    filled: NDArray[np.bool_]  # (rows, columns) something was measured
    reach_m: NDArray[np.float64]  # (rows, columns) mean horizontal range


def hole_share(
    cloud: Points,
    measured: NDArray[np.bool_],
    *,
    min_height_share: float,
    free_reach_m: float,
    margin_share: float,
) -> float:
    """Return the share of the columns with a hole and nothing far away below it; 0 for flat clouds of few points.

    Args:
        cloud: (N, 3) or organized (H, W, 3) metres, sensor frame.
        measured: (N,) or (H, W) points to use.
        min_height_share: least height of a hole, as a share of the image's.
        free_reach_m: horizontal range that makes a hole a free way if it was measured below it.
        margin_share: columns ignored on each side.
    """
    cells = _image_cells(cloud, measured) if cloud.ndim == 3 else _ray_cells(cloud[measured])
    if cells is None:
        return 0.0
    columns = cells.filled.shape[1]
    margin = round(margin_share * columns)
    filled, reach_m = (grid[:, margin : columns - margin] for grid in cells)
    min_run = max(1, round(min_height_share * len(filled)))
    missing_run = np.zeros(filled.shape[1], dtype=np.int64)  # cells in a row, from the lowest row upwards
    reach_below_m = np.zeros(filled.shape[1])
    has_hole = np.zeros(filled.shape[1], dtype=np.bool_)
    for row_filled, row_reach_m in zip(filled[::-1], reach_m[::-1], strict=True):
        missing_run = np.where(row_filled, 0, missing_run + 1)
        reach_below_m = np.where(row_filled, np.maximum(reach_below_m, row_reach_m), reach_below_m)
        has_hole |= (missing_run >= min_run) & (reach_below_m < free_reach_m)
    return float(has_hole.mean())


def _image_cells(cloud: Points, measured: NDArray[np.bool_]) -> _Cells:
    """Return the cells of an image (H, W, 3), turned upright."""
    size = max(1, min(measured.shape) // _GRID_ROWS)
    rows, columns = measured.shape[0] // size * size, measured.shape[1] // size * size

    def total(values: NDArray[np.float32]) -> NDArray[np.float64]:
        parts = [values[i:rows:size, j:columns:size] for i in range(size) for j in range(size)]
        sums: NDArray[np.float64] = np.sum(parts, axis=0, dtype=np.float64)
        return sums

    x, y, z = (np.where(measured, cloud[..., axis], np.float32(0)) for axis in range(3))
    count = total(measured.astype(np.float32))
    filled = count >= max(1.0, _MIN_CELL_SHARE * size**2)
    divisor = np.maximum(count, 1)
    reach_m = total(np.sqrt(x * x + y * y)) / divisor
    steepness = total(z) / divisor / np.maximum(reach_m, 1e-3)
    turns = _quarter_turns(filled, steepness)
    return _Cells(np.rot90(filled, turns), np.rot90(reach_m, turns))


def _quarter_turns(filled: NDArray[np.bool_], steepness: NDArray[np.float64]) -> int:
    """Return the counter-clockwise quarter turns that put an image upright: its steepest rays belong to the top."""
    row, column = np.nonzero(filled)
    if len(row) < 2:
        return 0
    steep = steepness[filled] - steepness[filled].mean()
    down = float((steep * (row - row.mean())).sum()) / max(1.0, float(row.var()))
    right = float((steep * (column - column.mean())).sum()) / max(1.0, float(column.var()))
    # The top of the scene is up, right, down or left in the image.
    return int(np.argmax((-down, right, down, -right)))


def _ray_cells(points: Points) -> _Cells | None:
    """Return cells between the outermost rays ahead of points (N, 3) without an image; None if they are too few."""
    share = min(1.0, len(points) / (_POINTS_PER_CELL * _GRID_ROWS * _GRID_COLUMNS))
    if share < _MIN_GRID_SHARE:
        return None
    rows, columns = round(_GRID_ROWS * share**0.5), round(_GRID_COLUMNS * share**0.5)
    ahead = points[points[:, 0] > 0].astype(np.float64)
    tangents = -ahead[:, 1:] / ahead[:, :1]  # (N, 2) right, down
    near = (np.abs(tangents) <= _MAX_TANGENT).all(axis=1)
    ahead, tangents = ahead[near], tangents[near]
    low, high = np.quantile(tangents, (0.005, 0.995), axis=0) if len(ahead) else (np.zeros(2), np.ones(2))
    shape = np.array((columns, rows))
    cell = np.clip((tangents - low) / np.maximum(high - low, 1e-6) * shape, 0, shape - 1).astype(np.int64)
    number = cell[:, 1] * columns + cell[:, 0]
    count = np.bincount(number, minlength=rows * columns)
    reach_m = np.bincount(number, np.hypot(ahead[:, 0], ahead[:, 1]), rows * columns)
    grid = (rows, columns)
    return _Cells((count > 0).reshape(grid), (reach_m / np.maximum(count, 1)).reshape(grid))
