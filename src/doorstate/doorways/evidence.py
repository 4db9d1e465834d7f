# SPDX-License-Identifier: Apache-2.0
"""Measurements of one doorway: shares of the cells of its opening, and ranges around the missing ones.

A cell is missing if no sight line crosses it although the wall on both sides of its row is measured densely enough, so
that far or grazing walls, and rows out of view, are no holes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.doorways.cell_shares import cell_shares
from doorstate.doorways.doorway import Doorway
from doorstate.doorways.elevation import ROW_M, Elevation, wall_elevation
from doorstate.doorways.expected_lines import Cells, expected_lines
from doorstate.doorways.measured_view import MeasuredView
from doorstate.doorways.opening_surfaces import floor_behind_share, is_across, is_flush
from doorstate.doorways.plan_lines import Floats, Line
from doorstate.doorways.walls import Wall

_RIM_M = 0.6  # stretch of wall on each side
_EDGE_M = 0.1  # of the opening, which its frame may hide
_ROWS = slice(round(0.1 / ROW_M), round(2.0 / ROW_M))  # above thresholds, below lintels
_BEFORE_M = (0.1, 1.0)  # floor before an opening
_FLOOR_M = 0.1  # of a point to the height of the floor
_MIN_FLOOR_POINTS = 8


@dataclass(frozen=True, eq=False)
class DoorwayEvidence:
    """Shares of the cells of an opening that are in view, and ranges about it; the first four shares sum to 1.

    Attributes:
        in_view: share of the opening's cells that are in view.
        on_wall: share in which the wall or a leaf in it was measured.
        through: share through which something farther behind was measured.
        hidden: share before which something stands.
        missing: share from which nothing came back.
        cells: cells of the wall about the opening, from which all else is computed.
    """

    in_view: float
    on_wall: float
    through: float
    hidden: float
    missing: float
    cells: OpeningCells

    @cached_property
    def flush(self) -> float:
        """Share in which a surface lies in one plane along the wall, as the wall itself or a closed leaf does."""
        return self.on_wall * _mean(self._is_flush[self._has_surface])

    @cached_property
    def across(self) -> float:
        """Share in which the far jamb was measured, or a leaf that stands before the near one."""
        return self.on_wall * _mean(self._is_across[self._has_surface])

    @property
    def free(self) -> float:
        """Share before and across which nothing stands."""
        return max(0.0, 1 - self.hidden - self.across)

    @cached_property
    def floor_behind(self) -> float:
        """Share of the sight lines expected on the floor behind that ended behind; NaN if too few are expected."""
        cells = self.cells
        # Other surfaces, as of a leaf in the opening, neither show the floor behind nor exclude it.
        is_other = (self._has_surface & ~self._is_flush) | (cells.lines[2] > 0)
        along_m, distance_m = cells.along_m, cells.wall.distance_m
        return floor_behind_share(
            cells.lines[1],
            np.where(is_other, 0.0, cells.expected * cells.in_view),
            np.stack([np.hypot(along_m, distance_m), np.full(len(along_m), distance_m)], axis=1),
            np.linspace(_ROWS.start + 0.5, _ROWS.stop - 0.5, _ROWS.stop - _ROWS.start) * ROW_M,
            -cells.doorway.floor_z_m,
            self.farthest_m,
        )

    @cached_property
    def rim_m(self) -> float:
        """Median range of the wall beside the opening; NaN if none was measured."""
        right, left = self.cells.rims
        return _median(self._ranges_m[right | left])

    @cached_property
    def hole_m(self) -> float:
        """Lower quartile of the ranges of the cells beside missing ones; NaN if none are missing."""
        return _hole_range_m(self.cells.is_missing, self._ranges_m)

    @property
    def nearest_m(self) -> float:
        """Least range in the cloud (`MeasuredView.range_limits_m`)."""
        return self.cells.view.range_limits_m[0]

    @property
    def farthest_m(self) -> float:
        """Largest range in the cloud (`MeasuredView.range_limits_m`)."""
        return self.cells.view.range_limits_m[1]

    @cached_property
    def has_floor_before(self) -> bool:
        """True if the floor before the opening was measured."""
        return _has_floor_before(self.cells.view.points, self.cells.doorway)

    @cached_property
    def _relief_m(self) -> Cells:
        cells = self.cells
        relief_m: Cells = np.where(
            cells.lines[0] > 0, cells.elevation.relief_m[cells.stretch, _ROWS], np.nan
        ).astype(np.float64)
        return relief_m

    @cached_property
    def _has_surface(self) -> NDArray[np.bool_]:
        has_surface: NDArray[np.bool_] = (self.cells.in_view > 0) & np.isfinite(self._relief_m)
        return has_surface

    @cached_property
    def _is_across(self) -> NDArray[np.bool_]:
        cells, half_m = self.cells, self.cells.doorway.width_m / 2
        ends_m = cells.middle_m - half_m, cells.middle_m + half_m
        return is_across(cells.along_m, self._relief_m, cells.wall.distance_m, ends_m)

    @cached_property
    def _is_flush(self) -> NDArray[np.bool_]:
        relief_m = np.where(self._is_across, np.nan, self._relief_m)
        return is_flush(relief_m, self.cells.in_view, self.cells.rims)

    @cached_property
    def _ranges_m(self) -> Cells:
        cells = self.cells
        return _ranges_m(cells.elevation, cells.wall, cells.doorway.floor_z_m)[cells.stretch, _ROWS]


class OpeningCells(NamedTuple):
    """Cells (columns, rows) of the wall about an opening."""

    view: MeasuredView
    doorway: Doorway
    wall: Wall
    middle_m: float  # of the opening along the wall
    elevation: Elevation
    stretch: NDArray[np.bool_]  # columns of the elevation
    lines: Cells  # (3, columns, rows) sight lines that end on the wall, behind and before it
    rims: tuple[NDArray[np.bool_], NDArray[np.bool_]]  # columns to the right and left of the opening
    in_view: Cells
    expected: Cells  # sight lines
    is_missing: NDArray[np.bool_]

    @property
    def along_m(self) -> Floats:
        """Places of the columns along the wall."""
        return self.elevation.positions_m[self.stretch]


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
    in_view, expected = expected_lines(lines.sum(axis=0), opening, rims)
    shares, is_missing = cell_shares(lines, expected, in_view, rims)
    share_in_view = float(in_view[opening].mean()) if opening.any() else 0.0
    cells = OpeningCells(
        view, doorway, wall, middle_m, elevation, stretch, lines, rims, in_view, expected, is_missing
    )
    return DoorwayEvidence(share_in_view, *shares, cells)


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


def _hole_range_m(is_missing: NDArray[np.bool_], ranges_m: Cells) -> float:
    """Return the lower quartile of the ranges of the cells beside missing ones."""
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


def _mean(values: NDArray[np.bool_]) -> float:
    return float(values.mean()) if len(values) else 0.0


def _median(values: Floats) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else math.nan
