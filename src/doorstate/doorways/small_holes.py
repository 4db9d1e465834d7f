# SPDX-License-Identifier: Apache-2.0
"""Small holes of a cloud about a doorway: lost pixels, which are filled where the surface around is one plane."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.doorways.elevation import COLUMN_M, NUM_ROWS, RELIEF_M, ROW_M, crossed_cells
from doorstate.types import Indices, Points

_MAX_COLUMNS, _MAX_ROWS = round(0.2 / COLUMN_M), round(0.2 / ROW_M)
_HALF_WIDTH_M = 1.5  # of the wall about the doorway
_MIN_CELLS = 2  # narrower holes lie between the points of a crop anyway
# Least number of points expected in a hole, from the density around it: one place in a million is empty by chance.
_MIN_LOST = 14.0
_PLANE_M = 0.02  # of every point around to the plane
_PER_ROW = 2  # points of a filled cell, one above the other


class Filling(NamedTuple):
    """Points on the surface around small holes."""

    points: Points  # (K, 3)
    nearest: Indices  # (K,) row of the measured point nearest to each


class _Grid(NamedTuple):
    """Cells (columns, rows) of the wall's plane, and the points whose sight lines cross them."""

    low_m: NDArray[np.float64]  # (2,) corner
    counts: NDArray[np.int64]
    rows: Indices  # (K,) of the points
    cells: Indices  # (K,) number of the cell of each

    def points_of(self, cells: list[tuple[int, int]]) -> Indices:
        """Return the points of some cells, cell by cell in ascending order."""
        is_wanted = np.zeros(self.counts.shape, dtype=bool)
        is_wanted[tuple(np.transpose(cells))] = True
        wanted = np.flatnonzero(is_wanted.ravel()[self.cells])
        return self.rows[wanted[np.argsort(self.cells[wanted], kind="stable")]]


def fill_small_holes(points: Points, camera_m: Points) -> Filling:
    """Return points for the holes, at most 0.2 m across, whose surroundings all lie on one plane.

    Args:
        points: (N, 3) measured points in the doorway's frame.
        camera_m: (3,) place of the camera in it.
    """
    camera = camera_m.astype(np.float64)
    grid = _grid(points, camera)
    none = Filling(np.empty((0, 3), np.float32), np.empty(0, np.int64))
    if grid is None:
        return none
    parts = [
        part for hole in _small_holes(grid.counts) if (part := _fill(hole, grid, points, camera)) is not None
    ]
    if not parts:
        return none
    return Filling(
        np.concatenate([part.points for part in parts]), np.concatenate([part.nearest for part in parts])
    )


def _grid(points: Points, camera_m: NDArray[np.float64]) -> _Grid | None:
    if camera_m[1] <= 0:
        return None
    x, y, z = points.T.astype(np.float64, order="C") - camera_m[:, None]
    columns = round(2 * _HALF_WIDTH_M / COLUMN_M)
    corner_m = (-_HALF_WIDTH_M - camera_m[0], -camera_m[2])
    number, cell = crossed_cells((x, -y, z), 1e-3, float(camera_m[1]), corner_m, columns)
    if len(number) == 0:
        return None
    counts = np.bincount(cell, minlength=columns * NUM_ROWS).reshape(columns, NUM_ROWS)
    return _Grid(np.array([-_HALF_WIDTH_M, 0.0]), counts, number, cell)


def _small_holes(counts: NDArray[np.int64]) -> list[list[tuple[int, int]]]:
    """Return the cells of each hole between filled cells that is small in both directions."""
    empty = counts == 0
    small = _short_runs(empty, _MAX_COLUMNS) & _short_runs(empty.T, _MAX_ROWS).T
    if not small.any():
        return []
    from scipy.ndimage import label  # few clouds have small holes

    numbers, count = label(small)
    holes: list[list[tuple[int, int]]] = [[] for _ in range(count)]
    for column, row in np.argwhere(small).tolist():
        holes[numbers[column, row] - 1].append((column, row))
    return sorted(hole for hole in holes if len(hole) >= _MIN_CELLS)


def _short_runs(empty: NDArray[np.bool_], most: int) -> NDArray[np.bool_]:
    """Return the cells in runs of at most `most` empty cells along the first axis, with filled cells at both ends."""
    size = len(empty)
    place = np.arange(size)[:, None]
    before = np.maximum.accumulate(np.where(empty, -size, place), axis=0)  # nearest filled cell
    after = np.minimum.accumulate(np.where(empty, 2 * size, place)[::-1], axis=0)[::-1]
    short: NDArray[np.bool_] = empty & (after - before - 1 <= most)
    return short


def _fill(
    hole: list[tuple[int, int]], grid: _Grid, points: Points, camera_m: NDArray[np.float64]
) -> Filling | None:
    """Return the points of one hole, or None if what surrounds it is not measured all around or is no plane."""
    around = sorted({(c + i, r + j) for c, r in hole for i in (-1, 0, 1) for j in (-1, 0, 1)} - set(hole))
    counts = np.array([grid.counts[cell] for cell in around])
    if (counts == 0).any() or counts.mean() * len(hole) < _MIN_LOST:
        return None
    rows = grid.points_of(around)
    surface = points[rows].astype(np.float64)
    if (np.abs(surface[:, 1]) > RELIEF_M).any():
        return None
    middle = surface.mean(axis=0)
    normal = np.linalg.svd(surface - middle, full_matrices=False)[2][2]
    if (np.abs((surface - middle) @ normal) > _PLANE_M).any():
        return None
    steps = (np.arange(_PER_ROW) + 0.5) / _PER_ROW
    cells = np.array([(column + 0.5, row + step) for column, row in hole for step in steps])
    places = grid.low_m + cells * (COLUMN_M, ROW_M)
    rays = np.stack([places[:, 0], np.zeros(len(places)), places[:, 1]], axis=1) - camera_m
    filled = camera_m + rays * (((middle - camera_m) @ normal) / (rays @ normal))[:, None]
    gaps = ((filled[:, None] - surface[None]) ** 2).sum(axis=2)
    return Filling(filled.astype(np.float32), rows[gaps.argmin(axis=1)])
