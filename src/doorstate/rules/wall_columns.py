# SPDX-License-Identifier: Apache-2.0
"""Wall in columns, each occupied, hidden, void or outside the view (cells of the wall plane, Quintana et al. 2018)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from doorstate.doorways.plan_lines import Flags, Floats, Line
from doorstate.rules.floor_plan import FloorPlan, azimuth_rad

_MIN_GAP_COLUMNS = 3
_BESIDE_HINGE_M = (0.1, 0.7)  # where a hinge has wall on one side and none on the other
_OCCUPIED, _HIDDEN, _VOID, _OUTSIDE = range(4)

Gap = tuple[float, float]
"""First and last position along a wall, in metres."""


@dataclass(frozen=True, eq=False)
class WallColumns:
    """Wall along a line, column by column."""

    line: Line
    positions_m: Floats  # (C,) centres of the columns along the line
    contents: NDArray[np.int64]  # (C,) occupied, hidden, void or outside
    column_m: float

    @property
    def occupied(self) -> Flags:
        """(C,) columns in which the wall was measured."""
        occupied: Flags = self.contents == _OCCUPIED
        return occupied

    @property
    def ends_m(self) -> Floats:
        """First and last occupied position."""
        ends: Floats = self.positions_m[self.occupied][[0, -1]]
        return ends

    def gaps(self) -> list[Gap]:
        """Return the stretches without an occupied column; single columns do not count."""
        occupied = np.flatnonzero(self.occupied)
        before = np.flatnonzero(np.diff(occupied) > _MIN_GAP_COLUMNS)
        half_m = self.column_m / 2
        starts = self.positions_m[occupied[before]] + half_m
        ends = self.positions_m[occupied[before + 1]] - half_m
        return [(float(start), float(end)) for start, end in zip(starts, ends, strict=True)]

    def void_m(self, gap: Gap) -> float:
        """Return the length of a stretch through which the camera sees."""
        inside = self.contents[(self.positions_m > gap[0]) & (self.positions_m < gap[1])]
        return float((inside == _VOID).sum()) * self.column_m

    def longest_void_m(self) -> float:
        """Return the longest void, in a gap or beyond the ends of the wall."""
        first_m, last_m = self.ends_m
        beyond = (float(self.positions_m[0]), first_m), (last_m, float(self.positions_m[-1]))
        return max(self.void_m(stretch) for stretch in (*self.gaps(), *beyond))

    def unbroken_m(self) -> float:
        """Return the longest stretch of wall without a gap."""
        first_m, last_m = self.ends_m
        ends = [first_m, *np.ravel(self.gaps()), last_m]
        return float(max(end - start for start, end in zip(ends[::2], ends[1::2], strict=True)))

    def closing_direction(self, hinge: Floats, tip: Floats, void_share: float) -> float:
        """Return the direction along the wall in which a leaf closes, +1 or -1: that with less wall.

        Args:
            hinge: (2,) place of the hinge.
            tip: (2,) free end of the leaf.
            void_share: share of an opening that must be looked through; 0 is returned if both sides are wall.
        """
        from_hinge_m = self.positions_m - float(self.line.along_m(hinge))
        near_m, far_m = _BESIDE_HINGE_M
        walled = []
        for direction in (1.0, -1.0):
            side = self.contents[(direction * from_hinge_m > near_m) & (direction * from_hinge_m < far_m)]
            occupied, void = (float((side == kind).sum()) for kind in (_OCCUPIED, _VOID))
            walled.append((occupied - void) * self.column_m / (far_m - near_m))
        if min(walled) > 1 - void_share:
            return 0.0
        if walled[0] == walled[1]:  # neither side is visible; fewer doors stand open beyond 90 degrees
            return 1.0 if (tip - hinge) @ self.line.direction >= 0 else -1.0
        return float(np.sign(walled[1] - walled[0]))


def wall_columns(
    line: Line,
    plan: FloorPlan,
    points: Floats,
    *,
    column_m: float,
    in_front_m: float,
    recess_m: float,
    max_opening_m: float,
) -> WallColumns:
    """Return the columns of the wall along a line.

    Args:
        line: line of the wall in plan view.
        plan: floor plan of the cloud.
        points: (N, 3) metres, the cloud.
        column_m: width of a column.
        in_front_m: cells up to this far before the line belong to the wall.
        recess_m: cells up to this far behind it too.
        max_opening_m: the columns reach this far beyond the ends, as an opening may lie there.
    """
    behind_m, along_m = line.behind_m(plan.centres_m), line.along_m(plan.centres_m)
    in_wall = (behind_m >= -in_front_m) & (behind_m <= recess_m)
    first_m, last_m = along_m[in_wall].min() - max_opening_m, along_m[in_wall].max() + max_opening_m
    positions_m = np.arange(first_m + column_m / 2, last_m, column_m)
    column = np.floor((along_m - first_m) / column_m).astype(np.int64)
    contents = np.full(len(positions_m), _VOID)
    centres = line.centre + positions_m[:, None] * line.direction
    azimuth, range_m = azimuth_rad(centres), np.hypot(*centres.T)
    view = azimuth_rad(points)
    outside = (azimuth < view.min()) | (azimuth > view.max()) | (centres[:, 0] > points[:, 0].max())
    contents[outside] = _OUTSIDE
    front = plan.centres_m[behind_m < -in_front_m]
    front_range_m = np.hypot(*front.T)
    apart = np.abs(azimuth[:, None] - azimuth_rad(front))
    hides = (apart * front_range_m <= column_m / 2) & (front_range_m < range_m[:, None])
    contents[hides.any(axis=1)] = _HIDDEN
    contents[column[in_wall & (column >= 0) & (column < len(contents))]] = _OCCUPIED
    return WallColumns(line, positions_m, contents, column_m)
