# SPDX-License-Identifier: Apache-2.0
"""Holes in a cloud: columns of the view in which nothing was measured and no floor is visible farther away.

A hole is a run of missing pixels down a column of the image. It is a free way only if below it something was measured
farther away than a door can be: the floor behind an open door. Behind glass, dropout and things before the lens no such
floor is visible. A black, glossy or glass leaf leaves a hole in the shape of a doorway: as wide as a door, with a
surface on both sides.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.inference.view_cells import Cells, view_cells
from doorstate.types import Points

_DOOR_WIDTH_M = (0.5, 2.6)  # of leaves, double ones as well
_MIN_DOOR_COLUMNS = 3  # one or two lie between a leaf and its jamb
_MIN_DOOR_HEIGHT_M = 0.6  # black leaves may be measured in their upper half
_FLANK_COLUMNS = 2  # on each side; a jamb of a few centimetres may be missing
_MIN_FLANK_SHARE = 0.3  # of the cells beside a hole


class DoorHole(NamedTuple):
    """Hole in the shape of a doorway."""

    width_m: float
    height_m: float
    distance_m: float  # horizontal range of the surfaces beside it


class Holes(NamedTuple):
    """Holes without a floor behind them."""

    share: float  # of the columns
    door: DoorHole | None  # the widest in the shape of a doorway


class _Runs(NamedTuple):
    """Runs of missing cells, one for each column."""

    length: NDArray[np.int64]  # 0: no hole
    top: NDArray[np.int64]  # row


def find_holes(
    cloud: Points,
    measured: NDArray[np.bool_],
    *,
    min_height_share: float,
    free_reach_m: float,
    margin_share: float,
) -> Holes:
    """Return the share of the columns with a hole and nothing far away below it, and a hole like a doorway.

    Args:
        cloud: (N, 3) or organized (H, W, 3) metres, sensor frame.
        measured: (N,) or (H, W) points to use.
        min_height_share: least height of a hole, as a share of the image's.
        free_reach_m: horizontal range that makes a hole a free way if it was measured below it.
        margin_share: columns ignored on each side.
    """
    cells = view_cells(cloud, measured)
    if cells is None:
        return Holes(0.0, None)
    min_run = max(1, round(min_height_share * len(cells.filled)))
    runs = _runs(cells, min_run, free_reach_m)
    is_hole = runs.length > 0
    margin = round(margin_share * len(is_hole))
    doors = (_door_hole(cells, runs, first, last) for first, last in _groups(is_hole))
    found = [door for door in doors if door is not None]
    share = float(is_hole[margin : len(is_hole) - margin].mean())
    return Holes(share, max(found, key=lambda door: door.width_m, default=None))


def _runs(cells: Cells, min_run: int, free_reach_m: float) -> _Runs:
    """Return the longest run of each column, of at least `min_run` cells and without a floor below it."""
    rows, columns = cells.filled.shape
    current, length, top = (np.zeros(columns, dtype=np.int64) for _ in range(3))
    reach_below_m = np.zeros(columns)
    for row in range(rows - 1, -1, -1):
        filled = cells.filled[row]
        current = np.where(filled, 0, current + 1)
        reach_below_m = np.where(filled, np.maximum(reach_below_m, cells.reach_m[row]), reach_below_m)
        longer = (current >= np.maximum(min_run, length + 1)) & (reach_below_m < free_reach_m)
        length = np.where(longer, current, length)
        top = np.where(longer, row, top)
    return _Runs(length, top)


def _groups(mask: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Yield first and one past the last column of each group of columns in a row."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def _door_hole(cells: Cells, runs: _Runs, first: int, last: int) -> DoorHole | None:
    """Return a group of columns as a hole like a doorway, or None if it is none."""
    top = int(np.median(runs.top[first:last]))
    bottom = int(np.median((runs.top + runs.length)[first:last]))
    flanks = []
    for columns in (np.s_[max(0, first - _FLANK_COLUMNS) : first], np.s_[last : last + _FLANK_COLUMNS]):
        filled = cells.filled[top:bottom, columns]
        if filled.size == 0 or filled.mean() < _MIN_FLANK_SHARE:
            return None
        flanks.append(cells.points_m[top:bottom, columns][filled])
    left, right = (np.median(flank, axis=0) for flank in flanks)
    distances_m = [float(np.hypot(*flank[:2])) for flank in (left, right)]
    count = last - first
    width_m = float(np.hypot(*(left - right)[:2])) * count / (count + _FLANK_COLUMNS)
    height_m = float(np.ptp(np.concatenate(flanks)[:, 2]))
    low_m, high_m = _DOOR_WIDTH_M
    is_door = low_m <= width_m <= high_m and height_m >= _MIN_DOOR_HEIGHT_M and count >= _MIN_DOOR_COLUMNS
    if not is_door:
        return None
    return DoorHole(width_m, height_m, float(np.mean(distances_m)))
