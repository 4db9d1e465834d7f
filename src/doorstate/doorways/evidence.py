# SPDX-License-Identifier: Apache-2.0
"""Measurements of one doorway: shares of the cells of its opening, and ranges around the missing ones.

A cell is missing if no sight line crosses it although the wall on both sides of its row is measured densely enough, so
that far or grazing walls, and rows out of view, are no holes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.doorways.doorway import Doorway
from doorstate.doorways.elevation import ROW_M, Elevation, wall_elevation
from doorstate.doorways.measured_view import MeasuredView
from doorstate.doorways.plan_lines import Floats, Line
from doorstate.doorways.walls import Wall

_RIM_M = 0.6  # stretch of wall on each side
_EDGE_M = 0.1  # of the opening, which its frame may hide
_ROWS = slice(round(0.1 / ROW_M), round(2.0 / ROW_M))  # above thresholds, below lintels
_POOLS = (1, 2, 3)  # cells that are taken together, in both directions, where points are few
_MIN_FILLED = 0.9  # of the cells of each rim: seen along the wall, whole columns lie between two sight lines
_MIN_EXPECTED = 6.0  # sight lines of a cell: one in 400 such cells is empty by chance
_BEFORE_M = (0.1, 1.0)  # floor before an opening
_FLOOR_M = 0.1  # of a point to the height of the floor
_MIN_FLOOR_POINTS = 8
# Largest difference between the depth of a flush cell and the median depth of the opening: at least the first, at most
# the second, and between them three times the scatter of the wall on both sides.
_FLUSH_M, _MAX_FLUSH_M = 0.05, 0.1
_SCATTERS = 3.0

Cells = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DoorwayEvidence:
    """Shares of the cells of an opening that are in view, and ranges about it; the first four shares sum to 1.

    Attributes:
        in_view: share of the opening's cells that are in view.
        on_wall: share in which the wall or a leaf in it was measured.
        through: share through which something farther behind was measured.
        hidden: share before which something stands.
        missing: share from which nothing came back.
        about: cells about the opening.
    """

    in_view: float
    on_wall: float
    through: float
    hidden: float
    missing: float
    about: _About

    @cached_property
    def flush(self) -> float:
        """Share in which a surface lies in one plane along the wall, as the wall itself or a closed leaf does."""
        about = self.about
        relief_m = np.where(about.lines[0] > 0, about.elevation.relief_m[about.stretch, _ROWS], np.nan)
        return self.on_wall * _flush(relief_m, about.in_view, about.rims)

    @cached_property
    def rim_m(self) -> float:
        """Median range of the wall beside the opening; NaN if none was measured."""
        right, left = self.about.rims
        return _median(self._ranges_m[right | left])

    @cached_property
    def hole_m(self) -> float:
        """Least range of what surrounds the missing cells; NaN if none are missing."""
        return _hole_range_m(self.about.is_missing, self._ranges_m)

    @property
    def nearest_m(self) -> float:
        """Least range in the cloud."""
        return self.about.view.range_limits_m[0]

    @property
    def farthest_m(self) -> float:
        """Largest range in the cloud."""
        return self.about.view.range_limits_m[1]

    @cached_property
    def has_floor_before(self) -> bool:
        """True if the floor before the opening was measured."""
        return _has_floor_before(self.about.view.points, self.about.doorway)

    @cached_property
    def _ranges_m(self) -> Cells:
        about = self.about
        return _ranges_m(about.elevation, about.wall, about.doorway.floor_z_m)[about.stretch, _ROWS]


class _About(NamedTuple):
    """Cells (columns, rows) of the wall about an opening."""

    view: MeasuredView
    doorway: Doorway
    wall: Wall
    elevation: Elevation
    stretch: NDArray[np.bool_]  # columns of the elevation
    lines: Cells  # (3, columns, rows) sight lines that end on the wall, behind and before it
    rims: tuple[NDArray[np.bool_], NDArray[np.bool_]]  # columns to the right and left of the opening
    in_view: Cells
    is_missing: NDArray[np.bool_]


def find_evidence(view: MeasuredView, doorway: Doorway) -> DoorwayEvidence:
    """Return what a cloud shows of a doorway.

    Args:
        view: points of the cloud.
        doorway: pose and width of the doorway.
    """
    wall, middle_m = _wall_of(doorway)
    elevation = wall_elevation(wall, view.lines, doorway.floor_z_m)
    offsets_m = elevation.positions_m - middle_m
    half_m = doorway.width_m / 2
    stretch = np.abs(offsets_m) < half_m + _RIM_M
    offsets_m = offsets_m[stretch]
    opening = np.abs(offsets_m) < half_m - _EDGE_M
    rims = (-offsets_m > half_m, offsets_m > half_m)
    kinds = np.stack([elevation.on_wall, elevation.through, elevation.hidden])[:, stretch, _ROWS]
    lines: Cells = kinds.astype(np.float64)
    in_view, expected = _expected(lines.sum(axis=0), opening, rims)
    shares, is_missing = _shares(lines, expected, in_view, rims)
    share_in_view = float(in_view[opening].mean()) if opening.any() else 0.0
    about = _About(view, doorway, wall, elevation, stretch, lines, rims, in_view, is_missing)
    return DoorwayEvidence(share_in_view, *shares, about)


def _wall_of(doorway: Doorway) -> tuple[Wall, float]:
    """Return the stretch of wall about a doorway, and the place of its middle along the wall's line."""
    yaw = math.radians(doorway.yaw_deg)
    direction = np.array([math.cos(yaw), math.sin(yaw)])
    middle = np.array([doorway.x_m, doorway.y_m])
    middle_m = float(middle @ direction)
    line = Line(middle - middle_m * direction, direction)
    half_m = doorway.width_m / 2 + _RIM_M
    return Wall(line, middle_m - half_m, middle_m + half_m, 0.0), middle_m


def _ranges_m(elevation: Elevation, wall: Wall, floor_z_m: float) -> Cells:
    """Return the ranges (columns, rows) of the nearest kind of surface in each cell; NaN where there is none."""
    distance_m = max(wall.distance_m, 1e-3)
    up_m = floor_z_m + (np.arange(elevation.on_wall.shape[1]) + 0.5) * ROW_M
    to_plane_m = np.sqrt(distance_m**2 + elevation.positions_m[:, None] ** 2 + up_m**2)
    depth_m = np.full(elevation.on_wall.shape, np.nan)
    for counts, depths_m in (
        (elevation.through, elevation.behind_m),
        (elevation.on_wall, elevation.relief_m),
        (elevation.hidden, elevation.before_m),
    ):
        depth_m = np.where(counts > 0, depths_m, depth_m)
    ranges_m: Cells = to_plane_m * (1 + depth_m / distance_m)
    return ranges_m


def _expected(
    seen: Cells, opening: NDArray[np.bool_], rims: Sequence[NDArray[np.bool_]]
) -> tuple[Cells, Cells]:
    """Return the cells (columns, rows) of the opening that are in view, and the sight lines expected in each.

    Sight lines through a plane get fewer smoothly with its range, whatever they end on, so that those of the rims tell
    how many to expect between them. With one rim in view, cells count up to the outermost that was seen.
    """
    right, left = (_row_density(seen[rim]) for rim in rims)
    share = np.linspace(0, 1, int(opening.sum()))[:, None]  # from the right rim to the left one
    both = (right > 0) & (left > 0)
    one = np.maximum(right, left)
    floor = 1e-9
    between = np.maximum(right, floor) ** (1 - share) * np.maximum(left, floor) ** share
    filled = seen[opening] > 0
    from_right = np.cumsum(filled[::-1], axis=0)[::-1] > 0  # up to the outermost seen cell
    from_left = np.cumsum(filled, axis=0) > 0
    up_to = np.where(right > 0, from_right, from_left) & (one > 0)
    expected = np.where(both, between, np.broadcast_to(one, between.shape))
    shape = seen.shape
    in_view, all_expected = np.zeros(shape, dtype=bool), np.zeros(shape)
    in_view[opening] = np.where(both, True, up_to)
    all_expected[opening] = expected
    return in_view.astype(np.float64), all_expected


def _row_density(rim: Cells) -> Cells:
    """Return the mean number of sight lines (rows) of the cells of a rim that were measured; 0 where too few were."""
    if len(rim) == 0:
        return np.zeros(rim.shape[1])
    padded = np.concatenate([rim[:, :1], rim, rim[:, -1:]], axis=1)
    about = (padded[:, :-2] + padded[:, 1:-1] + padded[:, 2:]) / 3
    filled = np.count_nonzero(about, axis=0)
    density: Cells = np.where(filled >= 2, about.sum(axis=0) / np.maximum(filled, 1), 0)
    return density


def _shares(
    kinds: Cells, expected: Cells, in_view: Cells, rims: Sequence[NDArray[np.bool_]]
) -> tuple[tuple[float, float, float, float], NDArray[np.bool_]]:
    """Return the shares on the wall, through, hidden and missing, and the missing cells (columns, rows)."""
    is_missing = np.zeros(in_view.shape, dtype=bool)
    if in_view.sum() == 0:
        return (0.0, 0.0, 0.0, 0.0), is_missing
    seen = kinds.sum(axis=0)
    beside = [seen[rim][:, in_view.any(axis=0)] for rim in rims]
    for pool in _POOLS:
        lines, cells = _pooled(np.stack([expected * in_view, in_view]), pool)
        is_in_view = cells >= 0.5 * pool**2
        counted = is_in_view & (lines >= _MIN_EXPECTED)
        is_enough = counted.any() and np.count_nonzero(counted) >= 0.5 * np.count_nonzero(is_in_view)
        if is_enough and all(_filled_share(rim, pool) >= _MIN_FILLED for rim in beside):
            break
    else:
        counted = cells > 0  # too few points to tell a hole from chance in each cell
    pooled = _pooled(kinds * in_view, pool)
    totals = pooled.sum(axis=0)
    empty = counted & (totals == 0)
    filled = counted & (totals > 0)
    weights = cells / cells[counted].sum()
    parts = [float((part / np.maximum(totals, 1) * weights)[filled].sum()) for part in pooled]
    wide = empty.repeat(pool, axis=0).repeat(pool, axis=1)[: seen.shape[0], : seen.shape[1]]
    return (parts[0], parts[1], parts[2], float(weights[empty].sum())), wide & (in_view > 0) & (seen == 0)


def _filled_share(seen: Cells, pool: int) -> float:
    """Return the share of the pooled cells of a rim that were measured; 1 where none were, as out of view."""
    filled = _pooled(seen, pool) > 0
    return float(filled.mean()) if filled.any() else 1.0


def _flush(relief_m: Cells, in_view: Cells, rims: Sequence[NDArray[np.bool_]]) -> float:
    """Return the share of the cells with a surface in which it is as deep as the middle one of the opening."""
    depths_m = relief_m[(in_view > 0) & np.isfinite(relief_m)]
    if len(depths_m) == 0:
        return 0.0
    # The scatter of the wall itself is that of the sensor and of the doorway's direction.
    scatters_m = [_scatter_m(relief_m[rim]) for rim in rims]
    near_m = min(max(_FLUSH_M, _SCATTERS * max(scatters_m)), _MAX_FLUSH_M)
    return float((np.abs(depths_m - np.median(depths_m)) <= near_m).mean())


def _scatter_m(relief_m: Cells) -> float:
    finite_m = relief_m[np.isfinite(relief_m)]
    return float(np.median(np.abs(finite_m - np.median(finite_m)))) if len(finite_m) else 0.0


def _pooled(cells: Cells, pool: int) -> Cells:
    """Return the sums of blocks of cells (..., columns, rows)."""
    if pool == 1:
        return cells
    columns, rows = (-(-size // pool) for size in cells.shape[-2:])
    sums = np.zeros((*cells.shape[:-2], columns, rows))
    for i, j in product(range(pool), repeat=2):
        part = cells[..., i::pool, j::pool]
        sums[..., : part.shape[-2], : part.shape[-1]] += part
    return sums


def _hole_range_m(is_missing: NDArray[np.bool_], ranges_m: Cells) -> float:
    """Return the median of the nearer half of the ranges of the cells beside missing ones."""
    if not is_missing.any():
        return math.nan
    padded = np.pad(is_missing, 1)
    beside = padded[:-2, 1:-1] | padded[2:, 1:-1] | padded[1:-1, :-2] | padded[1:-1, 2:]
    near_m = ranges_m[beside & ~is_missing]
    near_m = near_m[np.isfinite(near_m)]
    return float(np.quantile(near_m, 0.25)) if len(near_m) else math.nan


def _has_floor_before(points: NDArray[np.float32], doorway: Doorway) -> bool:
    low = points[np.abs(points[:, 2] - np.float32(doorway.floor_z_m)) < _FLOOR_M]
    x, y, _ = doorway.to_doorway(low).T
    before = (np.abs(x) < doorway.width_m / 2) & (y > _BEFORE_M[0]) & (y < _BEFORE_M[1])
    return int(before.sum()) >= _MIN_FLOOR_POINTS


def _median(values: Floats) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else math.nan
