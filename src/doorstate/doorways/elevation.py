# SPDX-License-Identifier: Apache-2.0
"""Elevation of a wall: cells of its plane, each with the surfaces and sight lines that were measured there.

Every measured point is a sight line. It ends on the wall, before it or behind it, and crosses the plane of the wall in
one cell, so that a point on a far wall says of a cell of this wall that nothing stands in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from doorstate.doorways.plan_lines import Floats
from doorstate.doorways.walls import Wall

COLUMN_M = 0.05
ROW_M = 0.1
NUM_ROWS = 24  # up to 2.4 m above the floor
MAX_COLUMNS = 160
RELIEF_M = 0.35  # surfaces so near to the plane belong to the wall: leaves in it, casings, reveals
_BEYOND_M = 2.0  # columns beyond the measured ends of a wall, where a doorway may lie
_MIN_FORWARD = 0.05  # sine of a sight line to the plane: others cross it far away, if at all


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


def wall_elevation(wall: Wall, points: NDArray[np.float32], floor_z_m: float) -> Elevation:
    """Return the elevation of a wall.

    Args:
        wall: wall of the cloud.
        points: (N, 3) measured points, metres, level sensor frame.
        floor_z_m: height of the floor in the sensor frame.
    """
    normal, direction = (axis.astype(np.float32) for axis in (wall.line.normal, wall.line.direction))
    plan = points[:, :2]
    reach = plan @ normal
    distance = np.float32(max(wall.distance_m, 1e-3))
    ahead = reach > _MIN_FORWARD * np.sqrt(np.einsum("ij,ij->i", plan, plan))
    reach = reach[ahead]
    scale = distance / reach
    along = (plan[ahead] @ direction) * scale
    up = points[ahead, 2] * scale - np.float32(floor_z_m)
    first, last = wall.first_m - _BEYOND_M, wall.last_m + _BEYOND_M
    centre = np.clip(0.0, first, last)  # the foot of the perpendicular from the camera
    half = MAX_COLUMNS * COLUMN_M / 2
    low = max(first, min(centre - half, last - 2 * half))
    columns = min(MAX_COLUMNS, int(np.ceil((last - low) / COLUMN_M)))
    column = np.floor((along - np.float32(low)) / np.float32(COLUMN_M)).astype(np.int32)
    row = np.floor(up / np.float32(ROW_M)).astype(np.int32)
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < NUM_ROWS)
    behind = (reach - distance)[inside]
    kind = (behind > RELIEF_M).astype(np.int32) + 2 * (behind < -RELIEF_M)
    cell = (column[inside] * NUM_ROWS + row[inside]) * 3 + kind
    size = columns * NUM_ROWS * 3
    counts = np.bincount(cell, minlength=size).astype(np.float32).reshape(columns, NUM_ROWS, 3)
    sums = np.bincount(cell, behind, size).astype(np.float32).reshape(columns, NUM_ROWS, 3)
    means = sums / np.maximum(counts, 1)
    return Elevation(low, *(counts[..., k] for k in range(3)), *(means[..., k] for k in range(3)))
