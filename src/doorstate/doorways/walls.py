# SPDX-License-Identifier: Apache-2.0
"""Walls of a level cloud: upright planes, found as lines in plan view by a Hough transform of occupied cells.

Cells count by the height that was measured in them, so that neither distance nor density of the points matters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.coordinates import coordinates
from doorstate.doorways.plan_lines import Floats, Line, fit_line
from doorstate.types import Indices

_CELL_M = 0.05
_LEVEL_M = 0.1  # heights are measured or not in steps of this
_ANGLE_STEP_DEG = 1.5
_NEAR_M = 0.04  # of a wall's cells to its line: noise of a depth camera at 3 m
_MIN_HEIGHT_M = 0.5  # of a cell: more than skirting boards and seats
_MIN_AREA_M2 = 0.12  # measured area of the weakest wall: 10 cm of wall beside a door
_MAX_WALLS = 6
_SAME_DEG = 6.0  # a second line so near to the first in direction ...
_SAME_M = 0.06  # ... and place is the same wall
_COLUMN_M = 0.05
_REACH_M = 0.12  # points about a line from which it is fitted again
_INLIER_M = 0.015  # of the places of columns: less than the depth of a recessed leaf
_MAX_TURN_DEG = 8.0  # of a line when it is fitted again
_MAX_POINTS = 4000  # that one fit evaluates
_MAX_TRIALS = 60_000  # lines times columns


@dataclass(frozen=True, eq=False)
class Wall:
    """Upright plane in plan view, and the stretch of it that was measured."""

    line: Line  # its centre is the foot of the perpendicular from the camera
    first_m: float  # along the line
    last_m: float
    area_m2: float  # measured

    @property
    def distance_m(self) -> float:
        """Distance of the camera from the plane."""
        return float(self.line.normal @ self.line.centre)

    @property
    def yaw_deg(self) -> float:
        """Direction along the wall to its left as the camera sees it; a wall straight ahead has 90."""
        return math.degrees(math.atan2(self.line.direction[1], self.line.direction[0]))


def find_walls(points: Floats) -> list[Wall]:
    """Return the walls of a level cloud, the strongest first.

    Args:
        points: (N, 3) metres, sensor frame, z up, without floor and ceiling.
    """
    cells_m, heights_m = occupied_cells(points)
    plan = coordinates(points)[:2]
    if len(cells_m) < 2:
        return []
    walls: list[Wall] = []
    free = np.ones(len(cells_m), dtype=bool)
    angles = np.radians(np.arange(0, 180, _ANGLE_STEP_DEG))
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for _ in range(2 * _MAX_WALLS):
        if len(walls) == _MAX_WALLS or free.sum() < 2:
            break
        first = _strongest(cells_m[free], heights_m[free], normals)
        proposed = free & (np.abs(first.behind_m(cells_m)) <= _NEAR_M)
        if heights_m[proposed].sum() * _CELL_M < _MIN_AREA_M2:
            break
        line = _refined(first, plan)
        on_line = free & (np.abs(line.behind_m(cells_m)) <= _NEAR_M)
        along_m = line.along_m(cells_m[on_line])
        area_m2 = _area_m2(along_m, heights_m[on_line])
        if area_m2 < _MIN_AREA_M2 or any(_is_same(line, wall.line) for wall in walls):
            free &= ~proposed
            continue
        free &= ~on_line
        # A leaf a few centimetres deeper is a wall of its own.
        plan = plan[:, np.abs(_across_m(line, plan)) > 2 * _INLIER_M]
        walls.append(Wall(line, float(along_m.min()), float(along_m.max()), area_m2))
    return sorted(walls, key=lambda wall: -wall.area_m2)


def _area_m2(along_m: Floats, heights_m: Floats) -> float:
    """Return the measured area of cells on a line, which may lie side by side across it."""
    if len(along_m) == 0:
        return 0.0
    column = ((along_m - along_m.min()) / _COLUMN_M).astype(np.int64)
    highest_m = np.zeros(int(column.max()) + 1)
    np.maximum.at(highest_m, column, heights_m)
    return float(highest_m.sum()) * _COLUMN_M


def occupied_cells(points: Floats) -> tuple[Floats, Floats]:
    """Return the mean places (K, 2) of cells in plan view with upright things, and their measured heights (K,)."""
    if len(points) == 0:
        return np.empty((0, 2)), np.empty(0)
    x, y, z = coordinates(points)
    low = np.array([x.min(), y.min()])
    column, row = ((axis - start) / _CELL_M for axis, start in zip((x, y), low, strict=True))
    column, row = column.astype(np.int64), row.astype(np.int64)
    columns, rows = int(column.max()) + 1, int(row.max()) + 1
    number = column * rows + row
    level = ((z - z.min()) / _LEVEL_M).astype(np.int64)
    levels = int(level.max()) + 1
    filled = np.zeros(columns * rows * levels, dtype=bool)
    filled[number * levels + level] = True
    num_levels = np.bincount(np.flatnonzero(filled) // levels, minlength=columns * rows)
    heights_m = num_levels.astype(np.float64) * _LEVEL_M
    count = np.bincount(number, minlength=columns * rows)
    kept = np.flatnonzero(heights_m >= _MIN_HEIGHT_M)
    sums = [np.bincount(number, axis, len(count))[kept] for axis in (x, y)]
    return np.stack(sums, axis=1) / count[kept, None], heights_m[kept]


def _strongest(cells_m: Floats, heights_m: Floats, normals: Floats) -> Line:
    """Return the line with most measured area, fitted to the cells near it."""
    offsets = cells_m @ normals.T  # (K, angles)
    low = offsets.min()
    bins = ((offsets - low) / _NEAR_M).astype(np.int64)
    num_bins = int(bins.max()) + 2
    index = bins + np.arange(len(normals)) * num_bins
    weights = np.broadcast_to(heights_m[:, None], index.shape)
    votes = np.bincount(index.ravel(), weights.ravel(), num_bins * len(normals)).reshape(-1, num_bins)
    votes[:, 1:] += votes[:, :-1].copy()  # a line between two bins
    angle, offset_bin = np.unravel_index(int(votes.argmax()), votes.shape)
    offset_m = low + int(offset_bin) * _NEAR_M  # edge between the two bins
    near = np.abs(offsets[:, angle] - offset_m) <= _NEAR_M
    return _fit(cells_m[near], heights_m[near])


def _refined(line: Line, plan: Floats) -> Line:
    """Return the line on which most columns of the points near a first line lie.

    A leaf that lies deeper than its wall would turn a line of least squares.

    Args:
        line: first line.
        plan: (2, N) places of points.
    """
    behind_m = _across_m(line, plan)
    near = np.flatnonzero(np.abs(behind_m) <= _REACH_M)
    near = near[:: max(1, len(near) // _MAX_POINTS)]
    if len(near) < 2:
        return line
    behind_m = behind_m[near]
    along_m = line.direction @ (plan[:, near] - line.centre[:, None])
    middles_m, depths_m = _columns(along_m, behind_m)
    if len(middles_m) < 3:
        return line
    best = _best_columns(middles_m, depths_m)
    if best is None:
        return line
    return _fit(line.centre + middles_m[best, None] * line.direction + depths_m[best, None] * line.normal)


def _columns(along_m: Floats, behind_m: Floats) -> tuple[Floats, Floats]:
    """Return the middles along a line of the columns of points with three or more, and their median depths."""
    first_m = along_m.min()
    column = ((along_m - first_m) / _COLUMN_M).astype(np.int64)
    # Depths are smaller than one, so that one key sorts by column and depth.
    order = np.argsort(2 * column + behind_m)
    sorted_column = column[order]
    starts = np.flatnonzero(np.diff(sorted_column, prepend=-1))
    sizes = np.diff(starts, append=len(order))
    enough = sizes >= 3
    starts, sizes = starts[enough], sizes[enough]
    middles_m = (sorted_column[starts] + 0.5) * _COLUMN_M + first_m
    return middles_m, behind_m[order[starts + sizes // 2]]


def _best_columns(along_m: Floats, depths_m: Floats) -> NDArray[np.bool_] | None:
    """Return the columns near the line through two of them that most are near to; None if all such lines turn."""
    first, second = _pairs(len(along_m))
    slopes = (depths_m[second] - depths_m[first]) / (along_m[second] - along_m[first])
    flat = np.flatnonzero(np.abs(slopes) <= math.tan(math.radians(_MAX_TURN_DEG)))
    if len(flat) == 0:
        return None
    first, slopes = first[flat], slopes[flat]
    starts_m = depths_m[first] - slopes * along_m[first]
    # In place: the arrays are as large as the caches of a processor.
    gains = np.multiply.outer(slopes, along_m)
    np.subtract(depths_m, gains, out=gains)
    gains -= starts_m[:, None]
    gains /= _INLIER_M
    np.square(gains, out=gains)
    np.subtract(1, gains, out=gains)
    np.maximum(gains, 0, out=gains)
    best: NDArray[np.bool_] = gains[np.argmax(gains.sum(axis=1))] > 0
    return best


@lru_cache(maxsize=64)
def _pairs(count: int) -> tuple[Indices, Indices]:
    """Return the pairs of `count` columns that are tried, as the numbers of their first and second columns."""
    first, second = np.triu_indices(count, 1)
    step = max(1, len(first) * count // _MAX_TRIALS)
    return first[::step], second[::step]


def _across_m(line: Line, plan: Floats) -> Floats:
    """Return the distances (N,) of places (2, N) behind a line."""
    across_m: Floats = line.normal @ (plan - line.centre[:, None])
    return across_m


def _fit(cells_m: Floats, heights_m: Floats | None = None) -> Line:
    """Return the line of least squares; its direction points to the left as the camera sees it."""
    line = fit_line(cells_m, heights_m)
    normal = line.normal
    direction = np.array([-normal[1], normal[0]])
    return Line(normal * float(normal @ line.centre), direction)


def _is_same(line: Line, other: Line) -> bool:
    near = np.hypot(*(line.centre - other.centre)) <= _SAME_M
    return near and line.angle_deg(other) <= _SAME_DEG
