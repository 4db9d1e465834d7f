# SPDX-License-Identifier: Apache-2.0
"""Collisions and distances of boxes, mostly in plan view."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from doorstate.simulation.scene.box import Box

TOLERANCE_M = 0.005  # a leaf's edge is bevelled by about as much as its corner would cut into the jamb


def collide(boxes: Sequence[Box], obstacles: Sequence[Box], tolerance_m: float = TOLERANCE_M) -> bool:
    """Return True if a box overlaps an obstacle by more than the tolerance.

    Separating axis test in plan, and the overlap in height.
    """
    return bool(colliding(boxes, obstacles, tolerance_m).any())


def colliding(
    boxes: Sequence[Box], obstacles: Sequence[Box], tolerance_m: float = TOLERANCE_M
) -> NDArray[np.bool_]:
    """Return for each box True if it overlaps an obstacle by more than the tolerance; as `collide`."""
    if not boxes or not obstacles:
        return np.zeros(len(boxes), dtype=bool)
    center, axes, half = _plans(boxes, 1)
    obstacle_center, obstacle_axes, obstacle_half = _plans(obstacles, 0)
    apart = obstacle_center - center  # (N, M, 3)
    separated = np.abs(apart[..., 2]) > half[..., 2] + obstacle_half[..., 2] - tolerance_m
    # |cosine| between every axis of one box and every axis of the other: (N, M, 2, 2)
    cosines = np.abs(np.einsum("...ix,...jx->...ij", axes, obstacle_axes))
    for own_axes, own, opposite, rotated in (
        (axes, half, obstacle_half, cosines),
        (obstacle_axes, obstacle_half, half, cosines.swapaxes(-1, -2)),
    ):
        away = np.abs(np.einsum("...ix,...x->...i", own_axes, apart[..., :2]))
        reach = own[..., :2] + np.einsum("...ij,...j->...i", rotated, opposite[..., :2])
        separated |= (away > reach - tolerance_m).any(axis=-1)
    hits: NDArray[np.bool_] = np.logical_not(separated).any(axis=1)
    return hits


def distance_m(box: Box, target: Box) -> float:
    """Return the shortest distance in plan between two boxes; 0 if they overlap in plan."""
    level, target_level = (shape._replace(center_m=(*shape.center_m[:2], 0.0)) for shape in (box, target))
    if collide([level], [target_level], 0.0):
        return 0.0
    corners, target_corners = footprint(box), footprint(target)
    return min(
        _to_segment(point, edges[side - 1], edges[side])
        for points, edges in ((corners, target_corners), (target_corners, corners))
        for point in points
        for side in range(4)
    )


def footprint(box: Box) -> list[tuple[float, float]]:
    """Return the four corners in plan, in order around the box."""
    cos, sin = math.cos(box.yaw_rad), math.sin(box.yaw_rad)
    halves = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    sizes = [(a * box.size_m[0] / 2, b * box.size_m[1] / 2) for a, b in halves]
    return [(box.center_m[0] + x * cos - y * sin, box.center_m[1] + x * sin + y * cos) for x, y in sizes]


def _plans(
    boxes: Sequence[Box], axis: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return centres, unit axes and half sizes, with an axis inserted to broadcast over the other boxes."""
    turns = [(math.cos(box.yaw_rad), math.sin(box.yaw_rad)) for box in boxes]
    axes = np.array([((cos, sin), (-sin, cos)) for cos, sin in turns])
    center = np.array([box.center_m for box in boxes])
    half = np.array([box.size_m for box in boxes]) / 2
    return np.expand_dims(center, axis), np.expand_dims(axes, axis), np.expand_dims(half, axis)


def _to_segment(point: tuple[float, float], start: tuple[float, float], end: tuple[float, float]) -> float:
    along = (end[0] - start[0], end[1] - start[1])
    length2 = along[0] ** 2 + along[1] ** 2
    share = ((point[0] - start[0]) * along[0] + (point[1] - start[1]) * along[1]) / length2
    share = min(max(share, 0.0), 1.0)
    return math.hypot(point[0] - start[0] - share * along[0], point[1] - start[1] - share * along[1])
