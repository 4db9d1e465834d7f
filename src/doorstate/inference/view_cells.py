# SPDX-License-Identifier: Apache-2.0
"""Coarse image of a cloud: cells of the view with or without points."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.types import Points

# Cells of 8 x 8 pixels in a 640 x 480 image: hundredths of a door, tens of pixels to judge by.
_GRID_ROWS, _GRID_COLUMNS = 60, 80
_MIN_CELL_SHARE = 1 / 8  # of a cell's pixels; fewer are flying pixels
_POINTS_PER_CELL = 16  # of a flat cloud, on average; with fewer, cells are filled from their surroundings
_MIN_GRID_SHARE = 1 / 16
_SPARSE_ROWS, _SPARSE_COLUMNS = 30, 40
# A cell is empty if its nearest point is farther away than this many times the distance from that point to its own
# fourth neighbour: one in 1000 cells of a surface with points at random.
NEIGHBOUR, _MAX_GAP = 4, 1.3
# Flat clouds are evaluated within 45 degrees of straight ahead: no depth camera sees more.
_MAX_TANGENT = 1.0


class Cells(NamedTuple):
    """Coarse image of a cloud, the lowest row last."""

    filled: NDArray[np.bool_]  # (rows, columns) something was measured
    reach_m: NDArray[np.float64]  # (rows, columns) mean horizontal range
    points_m: NDArray[np.float64]  # (rows, columns, 3) mean point


def view_cells(cloud: Points, measured: NDArray[np.bool_]) -> Cells | None:
    """Return the cells of a cloud, (N, 3) or organized (H, W, 3); None if too few points lie ahead.

    Args:
        cloud: metres, sensor frame.
        measured: (N,) or (H, W) points to use.
    """
    return _image_cells(cloud, measured) if cloud.ndim == 3 else _ray_cells(cloud[measured])


def _image_cells(cloud: Points, measured: NDArray[np.bool_]) -> Cells:
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
    points_m = np.stack([total(values) / divisor for values in (x, y, z)], axis=-1)
    steepness = points_m[..., 2] / np.maximum(reach_m, 1e-3)
    turns = _quarter_turns(filled, steepness)
    return Cells(np.rot90(filled, turns), np.rot90(reach_m, turns), np.rot90(points_m, turns))


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


def _ray_cells(points: Points) -> Cells | None:
    """Return cells between the outermost rays ahead of points (N, 3) without an image."""
    ahead = points[points[:, 0] > 0].astype(np.float64)
    tangents = -ahead[:, 1:] / ahead[:, :1]  # (N, 2) right, down
    near = (np.abs(tangents) <= _MAX_TANGENT).all(axis=1)
    ahead, tangents = ahead[near], tangents[near]
    if len(ahead) <= NEIGHBOUR:
        return None
    low, high = np.quantile(tangents, (0.005, 0.995), axis=0)
    size = np.maximum(high - low, 1e-6)
    share = min(1.0, len(points) / (_POINTS_PER_CELL * _GRID_ROWS * _GRID_COLUMNS))
    if share < _MIN_GRID_SHARE:
        return _sparse_cells(ahead, (tangents - low) / size)
    rows, columns = round(_GRID_ROWS * share**0.5), round(_GRID_COLUMNS * share**0.5)
    shape = np.array((columns, rows))
    cell = np.clip((tangents - low) / size * shape, 0, shape - 1).astype(np.int64)
    number = cell[:, 1] * columns + cell[:, 0]
    count = np.bincount(number, minlength=rows * columns)

    def mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
        sums = np.bincount(number, values, rows * columns) / np.maximum(count, 1)
        return sums.reshape(rows, columns)

    points_m = np.stack([mean(ahead[:, axis]) for axis in range(3)], axis=-1)
    return Cells((count > 0).reshape(rows, columns), mean(np.hypot(ahead[:, 0], ahead[:, 1])), points_m)


def _sparse_cells(points: NDArray[np.float64], places: NDArray[np.float64]) -> Cells:
    """Return cells with the nearest point of each, filled if it is as near as the points there are to each other.

    Args:
        points: (N, 3) metres.
        places: (N, 2) place in the view, 0 to 1 to the right and down.
    """
    across = (np.arange(_SPARSE_COLUMNS) + 0.5) / _SPARSE_COLUMNS
    down = (np.arange(_SPARSE_ROWS) + 0.5) / _SPARSE_ROWS
    centres = np.stack(np.meshgrid(across, down), axis=-1)  # (rows, columns, 2)
    filled, nearest = nearest_measured(places, centres, _MAX_GAP)
    points_m = points[nearest]
    return Cells(filled, np.hypot(points_m[..., 0], points_m[..., 1]), points_m)


def nearest_measured(
    places: NDArray[np.floating[Any]], queries: NDArray[np.float64], max_gap: float
) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Return which queries lie among the places, and the nearest place of each.

    A query lies among them if its nearest place is no farther away than `max_gap` times the distance from that place to
    its own fourth neighbour.

    Args:
        places: (N, 2) places in the view, more than `NEIGHBOUR`.
        queries: (..., 2) places to judge.
        max_gap: factor of the distance.
    """
    from scipy.spatial import cKDTree  # takes longer to import than an image of points to predict

    tree = cKDTree(places, balanced_tree=False, compact_nodes=False)  # built in half the time
    gap, nearest = tree.query(queries)
    spacing = np.asarray(tree.query(places[nearest], [NEIGHBOUR + 1])[0])[..., 0]
    return gap <= max_gap * spacing, np.asarray(nearest)
