# SPDX-License-Identifier: Apache-2.0
"""Collisions and distances of boxes, mostly in plan view."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.simulation.scene.box import Box

TOLERANCE_M = 0.005  # a leaf's edge is bevelled by about as much as its corner would cut into the jamb


class Footprints(NamedTuple):
    """Boxes as arrays: what many boxes are checked against is converted once."""

    center: NDArray[np.float64]  # (N, 3)
    cos: NDArray[np.float64]  # (N,) of the turn
    sin: NDArray[np.float64]
    half: NDArray[np.float64]  # (N, 3) half sizes

    @classmethod
    def of(cls, boxes: Sequence[Box]) -> Footprints:
        """Return the arrays of some boxes."""
        center = np.array([box.center_m for box in boxes]).reshape(-1, 3)
        half = np.array([box.size_m for box in boxes]).reshape(-1, 3) / 2
        # math, not numpy: libm gives the same bits on processors with different SIMD instructions.
        cos, sin = ([turn(box.yaw_rad) for box in boxes] for turn in (math.cos, math.sin))
        return cls(center, np.array(cos), np.array(sin), half)

    def near(self, other: Footprints) -> Footprints:
        """Return the boxes that may touch the bounding box in plan of some others."""
        reach, other_reach = (np.hypot(one.half[:, 0], one.half[:, 1])[:, None] for one in (self, other))
        low = (other.center[:, :2] - other_reach).min(axis=0)
        high = (other.center[:, :2] + other_reach).max(axis=0)
        is_near = (self.center[:, :2] + reach > low) & (self.center[:, :2] - reach < high)
        chosen = np.flatnonzero(is_near.all(axis=1))
        return Footprints(self.center[chosen], self.cos[chosen], self.sin[chosen], self.half[chosen])

    def joined(self, other: Footprints) -> Footprints:
        """Return these boxes and some others."""
        return Footprints(*(np.concatenate(pair) for pair in zip(self, other, strict=True)))


def collide(
    boxes: Sequence[Box], obstacles: Sequence[Box] | Footprints, tolerance_m: float = TOLERANCE_M
) -> bool:
    """Return True if a box overlaps an obstacle by more than the tolerance.

    Separating axis test in plan, and the overlap in height.
    """
    return bool(colliding(boxes, obstacles, tolerance_m).any())


def colliding(
    boxes: Sequence[Box], obstacles: Sequence[Box] | Footprints, tolerance_m: float = TOLERANCE_M
) -> NDArray[np.bool_]:
    """Return for each box True if it overlaps an obstacle by more than the tolerance; as `collide`."""
    if not boxes:
        return np.zeros(0, dtype=bool)
    own = Footprints.of(boxes)
    other = obstacles if isinstance(obstacles, Footprints) else Footprints.of(obstacles)
    if tolerance_m >= 0:
        other = other.near(own)
    if not len(other.cos):
        return np.zeros(len(boxes), dtype=bool)
    cos, sin, half = own.cos[:, None], own.sin[:, None], own.half[:, None]
    x, y, z = np.moveaxis(other.center - own.center[:, None], -1, 0)  # (N, M) each
    separated = np.abs(z) > half[..., 2] + other.half[:, 2] - tolerance_m
    # |cosine| and |sine| of the turn between the two
    along = np.abs(cos * other.cos + sin * other.sin)
    across = np.abs(sin * other.cos - cos * other.sin)
    for c, s, (width, depth), (other_width, other_depth) in (
        (cos, sin, (half[..., 0], half[..., 1]), (other.half[:, 0], other.half[:, 1])),
        (other.cos, other.sin, (other.half[:, 0], other.half[:, 1]), (half[..., 0], half[..., 1])),
    ):
        separated |= np.abs(c * x + s * y) > width + along * other_width + across * other_depth - tolerance_m
        separated |= np.abs(c * y - s * x) > depth + across * other_width + along * other_depth - tolerance_m
    hits: NDArray[np.bool_] = np.any(~separated, axis=1)
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


def _to_segment(point: tuple[float, float], start: tuple[float, float], end: tuple[float, float]) -> float:
    along = (end[0] - start[0], end[1] - start[1])
    length2 = along[0] ** 2 + along[1] ** 2
    share = ((point[0] - start[0]) * along[0] + (point[1] - start[1]) * along[1]) / length2
    share = min(max(share, 0.0), 1.0)
    return math.hypot(point[0] - start[0] - share * along[0], point[1] - start[1] - share * along[1])
