# SPDX-License-Identifier: Apache-2.0
"""Leaf of an open door: surfaces as wide as the opening, looked for at every angle about both of its ends.

A leaf ends where a wall goes on. So what reaches beyond the leaf's free edge, or above it, is none.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.doorways.doorway import Doorway
from doorstate.doorways.measured_view import MeasuredView
from doorstate.doorways.reach import Reach
from doorstate.types import Hinge, Swing

Angles = tuple[float, ...]

OPEN_ANGLES_DEG: Angles = tuple(float(angle) for angle in range(60, 136, 5))  # beyond, walls look like leaves
SEMI_OPEN_ANGLES_DEG: Angles = tuple(float(angle) for angle in range(10, 91, 5))
_SIDE_M = 0.05  # of the cells in plan view; points in the 3 x 3 about a place lie within 8 cm on average
_LEVEL_M, _LOWEST_M = 0.3, 0.1
_LEAF_LEVELS, _ABOVE_LEVEL, _NUM_LEVELS = 6, 7, 8  # 0.1 to 1.9 m, and 2.2 to 2.5 m
_STARTS, _STOPS = 0.3, 0.95  # of the leaf's width: beyond the reveal beside the hinge
_STEPS = 8
_BEYOND_M = (0.15, 0.25)  # of the free edge
_GOES_ON = 0.5  # of the cells in view beyond or above the leaf: a wall
_BESIDE = 2  # angles on each side of that of a wall
_WALL_M = (-0.25, 0.15)  # beside the opening: the wall itself, which a leaf folded back lies on
MIN_WIDTH_M = 0.55  # of one leaf of double doors
_MIN_CELLS = 10  # of the leaf, in view
_MIN_SHARE = 0.7  # of the cells of a leaf in view that were measured
_OUTER, _MIN_OUTER_CELLS = 4, 5  # outer steps of the leaf, and least cells in view there: reveals have none


def _cells_by_part() -> NDArray[np.bool_]:
    """Return which cells (part, step, level) belong to the leaf, its outer part, beyond its free edge and above it."""
    step = np.arange(_STEPS + len(_BEYOND_M))[:, None]
    level = np.arange(_NUM_LEVELS)
    is_along, is_level = step < _STEPS, level < _LEAF_LEVELS
    is_outer = step >= _STEPS - _OUTER
    return np.stack(
        [
            is_along & is_level,
            is_along & is_outer & is_level,
            ~is_along & is_level,
            is_along & (level == _ABOVE_LEVEL),
        ]
    )


_PARTS = _cells_by_part()


class SeenLeaf(NamedTuple):
    """Surface where the leaf of a door would be."""

    share: float  # of its cells in view that were measured; that of its outer half if it is smaller
    angle_deg: float
    hinge: Hinge
    swing: Swing
    width_m: float


def sweep_leaf(view: MeasuredView, doorway: Doorway, angles_deg: Angles = OPEN_ANGLES_DEG) -> SeenLeaf | None:
    """Return the leaf of which most was measured, or None if no leaf was.

    Args:
        view: points of the cloud.
        doorway: pose and width of the opening.
        angles_deg: opening angles to look at.
    """
    widths_m = [doorway.width_m] + [doorway.width_m / 2] * (doorway.width_m >= 2 * MIN_WIDTH_M)
    occupied = _occupied(view, doorway)
    best: SeenLeaf | None = None
    for width_m in widths_m:
        leaf = _best_leaf(doorway, width_m, np.asarray(angles_deg), occupied, view.reach)
        if leaf is not None and leaf.share >= _MIN_SHARE and (best is None or leaf.share > best.share):
            best = leaf
    return best


def _best_leaf(
    doorway: Doorway,
    width_m: float,
    angles_deg: NDArray[np.float64],
    occupied: NDArray[np.bool_],
    reach: Reach,
) -> SeenLeaf | None:
    hinges, swings, angles = np.meshgrid((-1.0, 1.0), (-1.0, 1.0), np.radians(angles_deg), indexing="ij")
    along = np.concatenate([np.linspace(_STARTS, _STOPS, _STEPS) * width_m, width_m + np.asarray(_BEYOND_M)])
    # From the hinge at one end towards the other, turned by the angle; y is towards the camera.
    x = hinges[..., None] * (doorway.width_m / 2 - along * np.cos(angles)[..., None])
    y = swings[..., None] * along * np.sin(angles)[..., None]
    places = np.stack([x, y, np.zeros_like(x)], axis=-1).astype(np.float32)
    heights_m = _LOWEST_M + (np.arange(_NUM_LEVELS) + 0.5) * _LEVEL_M + doorway.floor_z_m
    in_view = reach.includes(doorway.to_sensor(places), heights_m.astype(np.float32))
    beside = (np.abs(x) > doorway.width_m / 2) & (y > _WALL_M[0]) & (y < _WALL_M[1])
    in_view &= ~beside[..., None]
    filled = _look_up(occupied, x, y) & in_view
    totals = _counts(in_view, _PARTS)
    leaf, outer, beyond, above = _counts(filled, _PARTS) / np.maximum(totals, 1)
    is_enough = (totals[0] >= _MIN_CELLS) & (totals[1] >= _MIN_OUTER_CELLS)
    shares = np.where(is_enough, np.minimum(leaf, outer), 0.0)
    goes_on = (beyond > _GOES_ON) | (above > _GOES_ON)
    shares[_widened(goes_on)] = 0.0
    hinge, swing, first = (int(index) for index in np.unravel_index(int(shares.argmax()), shares.shape))
    if shares[hinge, swing, first] == 0:
        return None
    number = _middle(shares[hinge, swing], first)
    return SeenLeaf(
        float(shares[hinge, swing, number]),
        float(angles_deg[number]),
        "left" if hinge else "right",
        "towards" if swing else "away",
        width_m,
    )


def _middle(shares: NDArray[np.float64], first: int) -> int:
    """Return the middle of the run of equal shares that starts at an angle."""
    others = np.flatnonzero(shares[first:] != shares[first])
    return first + ((int(others[0]) if len(others) else len(shares) - first) - 1) // 2


def _widened(is_wall: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the angles (..., angle) of walls and those beside them, at which a leaf would still lie on the wall."""
    widened = is_wall.copy()
    for step in range(1, _BESIDE + 1):
        widened[..., step:] |= is_wall[..., :-step]
        widened[..., :-step] |= is_wall[..., step:]
    return widened


def _counts(cells: NDArray[np.bool_], parts: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the number (part, ...) of the cells (..., step, level) that belong to each part (part, step, level)."""
    flat = cells.reshape(*cells.shape[:-2], -1).astype(np.float64)
    return np.moveaxis(flat @ parts.reshape(len(parts), -1).T.astype(np.float64), -1, 0)


def _half_m(doorway: Doorway) -> tuple[float, float]:
    """Return half of the sides, along the wall and across it, of the rectangle that leaves can reach."""
    return 1.5 * doorway.width_m + 0.4, doorway.width_m + 0.4


def _occupied(view: MeasuredView, doorway: Doorway) -> NDArray[np.bool_]:
    """Return the cells (x, y, level) of the doorway's frame with points in them or beside them in plan view."""
    half_x, half_y = _half_m(doorway)
    size = (int(2 * half_x / _SIDE_M) + 3, int(2 * half_y / _SIDE_M) + 3, _NUM_LEVELS)
    around = np.hypot(half_x, half_y)
    x, y, _ = view.lines.ends_m
    near = np.flatnonzero(
        (np.abs(x - np.float32(doorway.x_m)) < around) & (np.abs(y - np.float32(doorway.y_m)) < around)
    )
    x, y, z = doorway.to_doorway(view.points.take(near, axis=0)).T
    column, row = ((x + half_x) / _SIDE_M).astype(np.int64) + 1, ((y + half_y) / _SIDE_M).astype(np.int64) + 1
    level = np.floor((z - _LOWEST_M) / _LEVEL_M).astype(np.int64)
    inside = (np.abs(x) < half_x) & (np.abs(y) < half_y) & (level >= 0) & (level < _NUM_LEVELS)
    cells = np.zeros(size, dtype=bool)
    cells[column[inside], row[inside], level[inside]] = True
    wide = cells.copy()
    wide[1:] |= cells[:-1]
    wide[:-1] |= cells[1:]
    occupied = wide.copy()
    occupied[:, 1:] |= wide[:, :-1]
    occupied[:, :-1] |= wide[:, 1:]
    return occupied


def _look_up(
    occupied: NDArray[np.bool_], x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return the occupied levels (..., level) at places in plan view."""
    column = ((x / _SIDE_M) + (occupied.shape[0] - 1) / 2).astype(np.int64)
    row = ((y / _SIDE_M) + (occupied.shape[1] - 1) / 2).astype(np.int64)
    found: NDArray[np.bool_] = occupied[
        np.clip(column, 0, occupied.shape[0] - 1), np.clip(row, 0, occupied.shape[1] - 1)
    ]
    return found
