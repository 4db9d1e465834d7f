# SPDX-License-Identifier: Apache-2.0
"""Sight lines through an opening: rays to the floor behind it that came back.

In an open doorway the floor behind the wall is measured, or the leaf that hides it. A black, glossy or glass leaf
returns nothing, so that most rays to that floor are missing, even where a pane shows the room behind.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.coordinates import coordinates
from doorstate.clouds.floor import lowest_z_m
from doorstate.inference.view_cells import NEIGHBOUR, nearest_measured
from doorstate.types import Points

# Rays cross the middle of the opening, whose edges may be some centimetres wrong, and meet the floor behind it.
_ACROSS = np.linspace(-0.35, 0.35, 12)  # of the width
_BEHIND_M = np.arange(0.1, 2.5, 0.1)  # along the ray
_DEPTH_SPOTS = 9  # the nearest in view of each line: as far as a leaf reaches
_MIN_REACH_M = 0.5  # behind the opening, however far away it is
_BEFORE_M = 0.3  # what stands as far before the wall says nothing of the opening
_PASSED_M = 0.3  # behind the face of the wall; leaves in thick walls and sliding ones behind them are nearer
_MAX_GAP = 1.5  # of view_cells.nearest_measured
_MAX_POINTS = 4096  # about the opening
_MIN_SPOTS = 12


class Opening(NamedTuple):
    """Ends of an opening in plan view, sensor frame."""

    left_m: tuple[float, float]
    right_m: tuple[float, float]

    @classmethod
    def in_frame(cls, x_m: float, y_m: float, yaw_deg: float, width_m: float) -> Opening:
        """Return the opening of a door frame: its middle, the direction of the wall towards its left, its width."""
        yaw = math.radians(yaw_deg)
        along_m, across_m = (width_m / 2 * part for part in (math.cos(yaw), math.sin(yaw)))
        return cls((x_m + along_m, y_m + across_m), (x_m - along_m, y_m - across_m))

    @classmethod
    def from_outline(cls, points_m: NDArray[np.float64]) -> Opening:
        """Return the outermost places, as the camera sees them, of an outline (K, 2) or (K, 3)."""
        places = points_m[:, :2]
        bearing = np.arctan2(places[:, 1], places[:, 0])
        left, right = places[bearing.argmax()].tolist(), places[bearing.argmin()].tolist()
        return cls((left[0], left[1]), (right[0], right[1]))

    @classmethod
    def beside_hinge(cls, wall_m: NDArray[np.float64], leaf_m: NDArray[np.float64]) -> tuple[Opening, ...]:
        """Return the two stretches of a wall beside the hinge of a leaf, as wide as the leaf.

        Args:
            wall_m: outline (K, 3) of the wall.
            leaf_m: outline (K, 3) of the leaf; its hinge is the end nearer to the line of the wall.
        """
        start, end = _ends(wall_m)
        along = (end - start) / max(1e-6, float(np.hypot(*(end - start))))
        normal = np.array([-along[1], along[0]])
        leaf = sorted(_ends(leaf_m), key=lambda place: abs(float((place - start) @ normal)))
        width_m = float(np.hypot(*(leaf[1] - leaf[0])))
        hinge = start + along * float((leaf[0] - start) @ along)
        return tuple(
            cls.from_outline(np.stack([hinge, hinge + side * width_m * along])) for side in (-1.0, 1.0)
        )


class FloorRays(NamedTuple):
    """Rays to the floor behind an opening that nothing before the wall hides."""

    seen: float  # share that came back
    passed: float  # share, of those to floor that lies well behind it, that came back from there


def seen_share(cloud: Points, measured: NDArray[np.bool_], opening: Opening, reach_m: float) -> float | None:
    """Return the share of the rays to the floor behind an opening that came back; arguments as for `floor_rays`."""
    rays = floor_rays(cloud, measured, opening, reach_m)
    return None if rays is None else rays.seen


def floor_rays(
    cloud: Points, measured: NDArray[np.bool_], opening: Opening, reach_m: float
) -> FloorRays | None:
    """Return what came back of the rays to the floor behind an opening; None where no floor is in view.

    Args:
        cloud: (N, 3) or organized (H, W, 3) metres, sensor frame.
        measured: (N,) or (H, W) points to use.
        opening: opening in a wall.
        reach_m: horizontal range up to which floor must be measured.
    """
    xyz = coordinates(cloud).take(np.flatnonzero(measured), axis=1)
    ahead = xyz[0] > 0
    some = xyz.take(np.flatnonzero(ahead)[:: max(1, xyz.shape[1] // _MAX_POINTS)], axis=1)
    if some.shape[1] <= NEIGHBOUR:
        return None
    spots = _floor_spots(opening, lowest_z_m(some.T), reach_m)
    rays = spots[..., 1:] / np.maximum(spots[..., :1], 1e-3)
    low, high = np.quantile(some[1:] / some[0], (0.005, 0.995), axis=1)
    in_view = (spots[..., 0] > 0) & ((rays >= low) & (rays <= high)).all(axis=-1)
    in_view &= np.cumsum(in_view, axis=1) <= _DEPTH_SPOTS
    rays = rays[in_view]
    if len(rays) < _MIN_SPOTS:
        return None
    margin = np.ptp(rays, axis=0).max() / 2
    near = ahead
    for axis, (first, last) in enumerate(
        zip(rays.min(axis=0) - margin, rays.max(axis=0) + margin, strict=True)
    ):
        near &= xyz[axis + 1] >= np.float32(first) * xyz[0]
        near &= xyz[axis + 1] <= np.float32(last) * xyz[0]
    rows = np.flatnonzero(near)
    points = xyz.T[rows[:: max(1, len(rows) // _MAX_POINTS)]].astype(np.float64)
    if len(points) <= NEIGHBOUR:
        return FloorRays(0.0, 0.0)
    tangents = points[:, 1:] / points[:, :1]
    is_measured, nearest = nearest_measured(tangents, rays, _MAX_GAP)
    behind_m = _behind_m(opening, points[nearest])
    before = is_measured & (behind_m < -_BEFORE_M)
    if (~before).sum() < _MIN_SPOTS:
        return None
    beyond = ~before & (_behind_m(opening, spots[in_view]) > _PASSED_M)
    passed = float((is_measured & (behind_m > _PASSED_M))[beyond].mean()) if beyond.any() else 0.0
    return FloorRays(float(is_measured[~before].mean()), passed)


def _ends(outline_m: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the two places of an upright outline in plan view that are farthest apart."""
    places = outline_m[:, :2]
    gaps = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    first, second = np.unravel_index(gaps.argmax(), gaps.shape)
    return places[first], places[second]


def _floor_spots(opening: Opening, floor_m: float, reach_m: float) -> NDArray[np.float64]:
    """Return spots (across, behind, 3) on the floor; NaN where they are out of reach."""
    middle, along, _ = _axes(opening)
    crossings = middle + _ACROSS[:, None] * along
    to_plane_m = np.hypot(*crossings.T)[:, None]
    to_floor_m = to_plane_m + _BEHIND_M
    plan = crossings[:, None] * (to_floor_m / np.maximum(to_plane_m, 1e-3))[..., None]
    spots = np.concatenate([plan, np.full((*plan.shape[:2], 1), floor_m)], axis=-1)
    spots[to_floor_m > np.maximum(reach_m, to_plane_m + _MIN_REACH_M)] = np.nan
    return spots


def _axes(opening: Opening) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the middle, the vector between the ends, and the normal away from the camera, in plan view."""
    left, right = np.asarray(opening.left_m), np.asarray(opening.right_m)
    along = left - right
    normal = np.array([along[1], -along[0]]) / max(1e-6, float(np.hypot(*along)))
    middle = (left + right) / 2
    return middle, along, normal * (1.0 if normal @ middle >= 0 else -1.0)


def _behind_m(opening: Opening, points: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    middle, _, normal = _axes(opening)
    behind_m: NDArray[np.float64] = (points[:, :2] - middle) @ normal
    return behind_m
