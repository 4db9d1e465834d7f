# SPDX-License-Identifier: Apache-2.0
"""Reach of the sight lines of a cloud: which places they reach or pass."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.types import Points

_RAY_TAN = 0.05  # side of the cells of the view
_MAX_TAN = 2.0
_SIZE = int(2 * _MAX_TAN / _RAY_TAN)
_MIN_DEPTH_M = 0.05
_NEARER_M = 0.15  # a sight line that ends so much nearer does not reach a place


class Reach(NamedTuple):
    """Depth along x of the farthest point in each cell (across, up) of a level view; 0 where there is none."""

    farthest_m: NDArray[np.float32]

    @classmethod
    def of(cls, ends_m: NDArray[np.float32]) -> Reach:
        """Return the reach of sight lines to points (3, N), metres, level sensor frame."""
        with np.errstate(all="ignore"):  # points beside the camera
            across, up = _cells(ends_m[1] / ends_m[0]), _cells(ends_m[2] / ends_m[0])
            inside = np.flatnonzero((ends_m[0] > _MIN_DEPTH_M) & _are_inside(across) & _are_inside(up))
        farthest_m = np.zeros(_SIZE * _SIZE, np.float32)
        cell = across[inside].astype(np.int64) * _SIZE + up[inside].astype(np.int64)
        np.maximum.at(farthest_m, cell, ends_m[0][inside])
        return cls(farthest_m.reshape(_SIZE, _SIZE))

    def includes(self, places_m: Points, heights_m: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Return which places (..., heights) sight lines reach or pass.

        Args:
            places_m: (..., 3) metres, level sensor frame; their height is not used.
            heights_m: heights above each place, in the same frame.
        """
        forward, left = places_m[..., 0, None], places_m[..., 1, None]
        depth: NDArray[np.float32] = np.maximum(forward, np.float32(_MIN_DEPTH_M))
        across, up = _cells(left / depth), _cells(heights_m / depth)
        inside = (_are_inside(across) & (forward > _MIN_DEPTH_M)) & _are_inside(up)
        last = np.float32(_SIZE - 1)
        column, row = (np.clip(cells, 0, last).astype(np.int64) for cells in (across, up))
        reached: NDArray[np.bool_] = self.farthest_m[column, row] > forward - _NEARER_M
        return reached & inside


def _cells(tangents: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the fractional cell numbers of tangents of sight lines."""
    cells: NDArray[np.float32] = (tangents + np.float32(_MAX_TAN)) / np.float32(_RAY_TAN)
    return cells


def _are_inside(cells: NDArray[Any]) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = (cells >= 0) & (cells < _SIZE)
    return inside
