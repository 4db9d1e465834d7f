# SPDX-License-Identifier: Apache-2.0
"""Shape of a surface where a leaf would be: flat, straight in plan view, and as high at its free edge as at its hinge.

Furniture, plants and people that stand beside an opening fill the place of a leaf, but seldom all of this.
"""

from __future__ import annotations

import math

import numpy as np

from doorstate.doorways.doorway import Doorway
from doorstate.doorways.leaf_sweep import SeenLeaf
from doorstate.doorways.measured_view import MeasuredView
from doorstate.doorways.plan_lines import Floats
from doorstate.types import Indices

_SLAB_M = 0.2  # on each side of the leaf's place, which is known to 10 degrees
_COLUMNS, _FIRST, _LAST = 8, 0.3, 0.95  # of the leaf's width
_LEVELS, _LOWEST_M, _HIGHEST_M = 6, 0.15, 1.85
_FLAT_M, _MIN_FLAT = 0.04, 0.7  # of the points to the line through the columns; handles stand out
_MAX_SLOPE = 0.25  # of that line to the leaf's place
_MIN_COLUMNS = 5
_MIN_FILLED = 0.7  # of the cells between the lowest and the highest level


def find_leaf_angle_deg(view: MeasuredView, doorway: Doorway, leaf: SeenLeaf) -> float | None:
    """Return the opening angle of a plane that fills a rectangle at the place of a leaf, or None if there is none.

    Args:
        view: points of the cloud.
        doorway: pose and width of the opening.
        leaf: place to look at.
    """
    column, level, along_m, off_m = _on_leaf(view, doorway, leaf)
    filled = np.zeros((_COLUMNS, _LEVELS), dtype=bool)
    filled[column, level] = True
    columns, levels = np.flatnonzero(filled.any(axis=1)), np.flatnonzero(filled.any(axis=0))
    if len(columns) < _MIN_COLUMNS or filled[:, levels[0] : levels[-1] + 1].mean() < _MIN_FILLED:
        return None
    middles_m = np.array([(np.median(along_m[column == c]), np.median(off_m[column == c])) for c in columns])
    slope, start_m = (float(value) for value in np.polyfit(middles_m[:, 0], middles_m[:, 1], 1))
    is_flat = (np.abs(off_m - start_m - slope * along_m) < _FLAT_M).mean() >= _MIN_FLAT
    if not is_flat or abs(slope) > _MAX_SLOPE:
        return None
    return leaf.angle_deg + math.degrees(math.atan(slope))


def _on_leaf(view: MeasuredView, doorway: Doorway, leaf: SeenLeaf) -> tuple[Indices, Indices, Floats, Floats]:
    """Return columns, levels, distances along the leaf and off it of the points at its place."""
    x, y, z = doorway.to_doorway(view.points).T.astype(np.float64)
    turn = math.radians(leaf.angle_deg)
    inward_m = doorway.width_m / 2 - (x if leaf.hinge == "left" else -x)  # from the hinge
    out_m = y if leaf.swing == "towards" else -y
    along_m = inward_m * math.cos(turn) + out_m * math.sin(turn)
    off_m = out_m * math.cos(turn) - inward_m * math.sin(turn)
    column = np.floor((along_m / leaf.width_m - _FIRST) / (_LAST - _FIRST) * _COLUMNS).astype(np.int64)
    level = np.floor((z - _LOWEST_M) / (_HIGHEST_M - _LOWEST_M) * _LEVELS).astype(np.int64)
    near = (np.abs(off_m) < _SLAB_M) & (column >= 0) & (column < _COLUMNS) & (level >= 0) & (level < _LEVELS)
    return column[near], level[near], along_m[near], off_m[near]
