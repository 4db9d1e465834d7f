# SPDX-License-Identifier: Apache-2.0
"""Elevation of a wall: cells of its plane, each with the surfaces and sight lines that were measured there.

Every measured point is a sight line. It ends on the wall, before it or behind it, and crosses the plane of the wall in
one cell, so that a point on a far wall says of a cell of this wall that nothing stands in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.coordinates import coordinates
from doorstate.doorways.plan_lines import Floats
from doorstate.doorways.walls import Wall
from doorstate.types import Indices

COLUMN_M = 0.05
ROW_M = 0.1
NUM_ROWS = 24  # up to 2.4 m above the floor
MAX_COLUMNS = 160
RELIEF_M = 0.35  # surfaces so near to the plane belong to the wall: leaves in it, casings, reveals
_BEYOND_M = 2.0  # columns beyond the measured ends of a wall, where a doorway may lie
_MIN_FORWARD = 0.05  # sine of a sight line to the plane: others cross it far away, if at all

_Reals = NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class Elevation:
    """Counts and mean depths of the sight lines through the cells (columns, rows) of a wall; row 0 is at the floor."""

    first_m: float  # along the wall's line, at the edge of column 0
    on_wall: NDArray[np.float32]  # sight lines that end within `RELIEF_M` of the plane
    through: NDArray[np.float32]  # that end farther behind
    hidden: NDArray[np.float32]  # that end farther before
    relief_m: NDArray[np.float32]  # mean depth behind the plane, of each of the three
    behind_m: NDArray[np.float32]
    before_m: NDArray[np.float32]

    @cached_property
    def seen(self) -> NDArray[np.float32]:
        """Sight lines of each cell."""
        return self.on_wall + self.through + self.hidden

    @property
    def positions_m(self) -> Floats:
        """Centres (columns,) along the wall's line."""
        return self.first_m + (np.arange(len(self.on_wall), dtype=np.float64) + 0.5) * COLUMN_M


class SightLines(NamedTuple):
    """Sight lines of a level cloud, for the elevations of its walls."""

    ends_m: NDArray[np.float32]  # (3, N) measured points
    min_reach_m: NDArray[np.float32]  # (N,) across a wall; those with less run along it

    @classmethod
    def to(cls, points: NDArray[np.float32]) -> SightLines:
        """Return the sight lines to measured points (N, 3), metres, level sensor frame."""
        x, y, _ = ends_m = coordinates(points)
        return cls(ends_m, np.float32(_MIN_FORWARD) * np.sqrt(x * x + y * y))


def wall_elevation(wall: Wall, lines: SightLines, floor_z_m: float) -> Elevation:
    """Return the elevation of a wall.

    Args:
        wall: wall of the cloud.
        lines: sight lines of the cloud.
        floor_z_m: height of the floor in the sensor frame.
    """
    along, across = (axis.astype(np.float32) for axis in (wall.line.direction, wall.line.normal))
    ends_m = (along @ lines.ends_m[:2], across @ lines.ends_m[:2], lines.ends_m[2])
    distance_m = max(wall.distance_m, 1e-3)
    first, last = wall.first_m - _BEYOND_M, wall.last_m + _BEYOND_M
    centre = np.clip(0.0, first, last)  # the foot of the perpendicular from the camera
    half = MAX_COLUMNS * COLUMN_M / 2
    low = max(first, min(centre - half, last - 2 * half))
    columns = min(MAX_COLUMNS, int(np.ceil((last - low) / COLUMN_M)))
    number, cell = crossed_cells(ends_m, lines.min_reach_m, distance_m, (low, floor_z_m), columns)
    behind = ends_m[1][number] - np.float32(distance_m)
    cell *= 3
    cell += behind > RELIEF_M
    cell += 2 * (behind < -RELIEF_M)
    size = columns * NUM_ROWS * 3
    counts = np.bincount(cell, minlength=size).astype(np.float32).reshape(columns, NUM_ROWS, 3)
    sums = np.bincount(cell, behind, size).astype(np.float32).reshape(columns, NUM_ROWS, 3)
    means = sums / np.maximum(counts, 1)
    return Elevation(low, *(counts[..., k] for k in range(3)), *(means[..., k] for k in range(3)))


def crossed_cells(
    ends_m: tuple[_Reals, _Reals, _Reals],
    min_reach_m: _Reals | float,
    distance_m: float,
    corner_m: tuple[float, float],
    columns: int,
) -> tuple[Indices, Indices]:
    """Return the numbers (K,) of the sight lines that cross cells of a plane, and those of the cells, by column.

    Args:
        ends_m: ends (N,) of the sight lines from the camera: along the plane, across it away from the camera, and up.
        min_reach_m: length across the plane that a sight line must exceed.
        distance_m: of the plane from the camera.
        corner_m: place along the plane and height of the lowest corner of its first cell.
        columns: number of columns.
    """
    along, across, up = ends_m
    real = across.dtype.type
    with np.errstate(all="ignore"):  # sight lines along the plane
        share = real(distance_m) / across
        column = (along * share - real(corner_m[0])) / real(COLUMN_M)
        row = (up * share - real(corner_m[1])) / real(ROW_M)
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < NUM_ROWS)
    number = np.flatnonzero(inside & (across > min_reach_m))
    return number, column[number].astype(np.int64) * NUM_ROWS + row[number].astype(np.int64)
