# SPDX-License-Identifier: Apache-2.0
"""Upright surfaces of a cloud as cells of a floor plan, and the lines among them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from doorstate.doorways.plan_lines import Flags, Floats, Line, strongest_line
from doorstate.doorways.planes import grid

_LEVEL_M = 0.1  # heights are measured or not in steps of this
_MAX_LINES = 5


@dataclass(frozen=True, eq=False)
class FloorPlan:
    """Cells in plan view in which something upright stands."""

    centres_m: Floats  # (K, 2)
    heights_m: Floats  # (K,) measured height of each
    tops_m: Floats  # (K,) above the camera


def floor_plan(points: Floats, cell_m: float, min_height_m: float) -> FloorPlan:
    """Return the cells with upright things.

    Args:
        points: (N, 3) metres.
        cell_m: size of a cell.
        min_height_m: least measured height of a cell.
    """
    cell, centres_m = grid(points[:, :2], cell_m)
    level = np.floor(points[:, 2] / _LEVEL_M).astype(np.int64)
    level_cells = np.unique(np.stack([cell, level], axis=1), axis=0)[:, 0]
    heights_m: Floats = np.bincount(level_cells, minlength=len(centres_m)) * np.float64(_LEVEL_M)
    tops_m = np.full(len(centres_m), -np.inf)
    np.maximum.at(tops_m, cell, points[:, 2])
    upright = heights_m >= min_height_m
    return FloorPlan(centres_m[upright], heights_m[upright], tops_m[upright])


def strongest_lines(cells: Floats, weights: Floats, threshold_m: float) -> Iterator[tuple[Line, Flags]]:
    """Yield lines in plan view, the strongest first, with a mask (K,) of the cells of each; no cell has two lines."""
    free = np.arange(len(cells))
    for _ in range(_MAX_LINES):
        fit = strongest_line(cells[free], threshold_m, weights[free])
        if fit is None:
            return
        line, on_line = fit
        mask = np.zeros(len(cells), dtype=bool)
        mask[free[on_line]] = True
        yield line, mask
        free = free[~on_line]


def azimuth_rad(places: Floats) -> Floats:
    """Return the directions (N,) of (N, 2) places or (N, 3) points from the camera."""
    azimuth: Floats = np.arctan2(places[:, 1], places[:, 0])
    return azimuth
