# SPDX-License-Identifier: Apache-2.0
"""What speaks for a doorway, read off the elevation of its wall."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from doorstate.doorways.elevation import ROW_M, Elevation

_HEIGHTS_M = (0.2, 1.9)  # of the cells that count: above thresholds, below lintels
_EDGE_M = 0.1  # cells so near to an end of the opening belong to the jambs


@dataclass(frozen=True)
class Cues:
    """Shares of the cells of an opening in which anything was measured, and the share of all in which it was."""

    on_wall: float = 0.0  # the wall, or a leaf in it
    seen_through: float = 0.0  # sight lines pass: open here
    hidden: float = 0.0  # something stands before it: a leaf towards the camera, or clutter
    measured: float = 0.0  # of all cells between the highest and the lowest measured ones


def find_cues(elevation: Elevation, first_m: float, last_m: float) -> Cues:
    """Return the cues of the stretch of a wall between two places along its line."""
    positions_m = elevation.positions_m
    columns = (positions_m > first_m + _EDGE_M) & (positions_m < last_m - _EDGE_M)
    rows = slice(round(_HEIGHTS_M[0] / ROW_M), round(_HEIGHTS_M[1] / ROW_M))
    seen = elevation.seen[columns, rows]
    filled = seen > 0
    if not filled.any():
        return Cues()

    def share(kind: NDArray[np.float32]) -> float:
        return float((kind[columns, rows] / np.maximum(seen, 1))[filled].mean())

    in_view = np.flatnonzero(filled.any(axis=0))
    return Cues(
        on_wall=share(elevation.on_wall),
        seen_through=share(elevation.through),
        hidden=share(elevation.hidden),
        measured=float(filled[:, in_view[0] : in_view[-1] + 1].mean()),
    )
