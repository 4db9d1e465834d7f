# SPDX-License-Identifier: Apache-2.0
"""Cells of an opening whose sight lines end on a surface along the wall or across it, or on the floor behind."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from doorstate.doorways.elevation import RELIEF_M
from doorstate.doorways.expected_lines import MIN_LINES, Cells
from doorstate.doorways.plan_lines import Floats

# Largest difference between the depth of a flush cell and the median depth of the opening: at least the first, at most
# the second, and between them three times the scatter of the wall on both sides.
_FLUSH_M, _MAX_FLUSH_M = 0.05, 0.1
_SCATTERS = 3.0
_ACROSS_M = 0.08  # of where a sight line ends to the end of the opening
_BEHIND_M = RELIEF_M + 0.05  # floor so far behind the wall is no threshold
_IN_RANGE = 0.95  # of the largest range


def is_across(
    along_m: Floats, relief_m: Cells, distance_m: float, ends_m: tuple[float, float]
) -> NDArray[np.bool_]:
    """Return the cells (columns, rows) whose sight lines end at the far jamb, or at a leaf before the near one.

    Args:
        along_m: (columns,) places along the wall, from the foot of the perpendicular from the camera.
        relief_m: (columns, rows) depth of the surfaces on the wall; NaN where there are none.
        distance_m: distance of the camera from the wall's plane.
        ends_m: right and left end of the opening along the wall.
    """
    away = np.sign(along_m)[:, None]
    middle_m, half_m = (ends_m[0] + ends_m[1]) / 2, (ends_m[1] - ends_m[0]) / 2
    from_middle_m = (along_m[:, None] * (1 + relief_m / max(distance_m, 1e-3)) - middle_m) * away
    is_jamb = (from_middle_m > half_m - _ACROSS_M) & (relief_m > _ACROSS_M / 2)
    is_leaf = (from_middle_m < _ACROSS_M - half_m) & (relief_m < -_ACROSS_M / 2)
    across: NDArray[np.bool_] = is_jamb | is_leaf
    return across


def is_flush(relief_m: Cells, in_view: Cells, rims: Sequence[NDArray[np.bool_]]) -> NDArray[np.bool_]:
    """Return the cells (columns, rows) of an opening with a surface as deep as the middle one of them.

    Args:
        relief_m: (columns, rows) depth of the surfaces on the wall; NaN where there are none.
        in_view: (columns, rows) above 0 for the cells of the opening that are in view.
        rims: columns beside the opening.
    """
    depths_m = relief_m[(in_view > 0) & np.isfinite(relief_m)]
    if len(depths_m) == 0:
        return np.zeros(relief_m.shape, dtype=bool)
    # The scatter of the wall itself is that of the sensor and of the doorway's direction.
    scatters_m = [_scatter_m(relief_m[rim]) for rim in rims]
    near_m = min(max(_FLUSH_M, _SCATTERS * max(scatters_m)), _MAX_FLUSH_M)
    flush: NDArray[np.bool_] = np.abs(relief_m - np.median(depths_m)) <= near_m
    return flush & (in_view > 0)


def floor_behind_share(
    through: Cells, expected: Cells, to_plane_m: Cells, heights_m: Floats, camera_m: float, farthest_m: float
) -> float:
    """Return the share of the sight lines expected on the floor behind that ended behind; NaN if too few are.

    Args:
        through: (columns, rows) sight lines that end behind the wall.
        expected: (columns, rows) sight lines expected; 0 in cells that tell nothing of the floor.
        to_plane_m: (columns, 2) horizontal distance to the cells, and to the wall's plane.
        heights_m: (rows,) heights above the floor.
        camera_m: height of the camera above the floor.
        farthest_m: largest range in the cloud.
    """
    scale = camera_m / np.maximum(camera_m - heights_m, 1e-3)  # of the way to the floor to that to the plane
    behind_m = to_plane_m[:, 1:] * (scale - 1)
    ranges_m = np.hypot(to_plane_m[:, :1] * scale, camera_m)
    is_floor = (heights_m < camera_m) & (behind_m > _BEHIND_M) & (ranges_m < _IN_RANGE * farthest_m)
    total = float(expected[is_floor].sum())
    is_counted = is_floor & (expected > 0)
    return min(1.0, float(through[is_counted].sum()) / total) if total >= MIN_LINES else math.nan


def _scatter_m(relief_m: Cells) -> float:
    finite_m = relief_m[np.isfinite(relief_m)]
    return float(np.median(np.abs(finite_m - np.median(finite_m)))) if len(finite_m) else 0.0
