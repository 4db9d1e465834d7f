# SPDX-License-Identifier: Apache-2.0
"""Lines in plan view, which upright surfaces are: a robust fit that tries many candidates at once."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_NUM_PAIRS = 400  # 16 of them lie on a surface with a fifth of the points
_NUM_REFITS = 3


@dataclass(frozen=True, eq=False)
class Line:
    """Line in plan view through `centre` (2,) metres along the unit vector `direction` (2,)."""

    centre: Floats
    direction: Floats

    @property
    def normal(self) -> Floats:
        """Unit vector (2,) across the line, away from the camera."""
        normal = np.array([-self.direction[1], self.direction[0]])
        return normal if normal @ self.centre >= 0 else -normal

    def along_m(self, points: Floats) -> Floats:
        """Return (N,) positions of (N, 2) points along the line, from its centre."""
        along: Floats = (points - self.centre) @ self.direction
        return along

    def behind_m(self, points: Floats) -> Floats:
        """Return (N,) distances of (N, 2) points; positive behind the line as the camera sees it."""
        behind: Floats = (points - self.centre) @ self.normal
        return behind

    def at(self, along_m: float) -> Floats:
        """Return the point (2,) of the line at a position."""
        point: Floats = self.centre + along_m * self.direction
        return point

    def foot(self, point: Floats) -> Floats:
        """Return the nearest point (2,) of the line to a point (2,)."""
        return self.at(float(self.along_m(point)))

    def crossing(self, other: Line) -> Floats:
        """Return the intersection (2,) with a line that is not parallel."""
        axes = np.stack([self.direction, -other.direction], axis=1)
        return self.at(float(np.linalg.solve(axes, other.centre - self.centre)[0]))

    def angle_deg(self, other: Line) -> float:
        """Return the angle between two lines, 0 to 90."""
        return angle_deg(self.direction, other.direction)


def strongest_line(
    points: Floats, threshold_m: float, weights: Floats | None = None, *, seed: int = 0
) -> tuple[Line, Flags] | None:
    """Return the line with most points, or most weight, within a distance, and a mask (N,) of these points.

    Random pairs of points propose lines; the best is fitted to its points by least squares (RANSAC, docs/adr/0006).

    Args:
        points: (N, 2) metres.
        threshold_m: largest distance of a point of the line.
        weights: (N,) weights of the points; all equal if None.
        seed: seed of the random pairs.

    Returns:
        None for fewer than two distinct points.
    """
    if len(points) < 2:
        return None
    weights = np.ones(len(points)) if weights is None else weights
    first, second = np.random.default_rng(seed).integers(len(points), size=(2, _NUM_PAIRS))
    axes = points[second] - points[first]
    lengths_m = np.hypot(*axes.T)
    apart = lengths_m > 2 * threshold_m  # the direction of nearer ones is noise
    if not apart.any():
        return None
    axes = axes[apart] / lengths_m[apart, None]
    normals = np.stack([-axes[:, 1], axes[:, 0]], axis=1)
    offsets = (normals * points[first[apart]]).sum(axis=1)
    near = np.abs(points @ normals.T - offsets) <= threshold_m  # (N, pairs)
    on_line: Flags = near[:, np.argmax(weights @ near)]
    for _ in range(_NUM_REFITS):
        line = fit_line(points[on_line], weights[on_line])
        refitted = np.abs(line.behind_m(points)) <= threshold_m
        if np.count_nonzero(refitted) < 2:
            break
        on_line = refitted
    return line, on_line


def fit_line(points: Floats, weights: Floats | None = None) -> Line:
    """Return the line with least squared distances to (N, 2) points."""
    # np.average and np.cov give the same bits, but check their arguments for longer than these few points take.
    weights = np.ones(len(points)) if weights is None else weights
    total = weights.sum()
    centre = (points * weights[:, None]).sum(axis=0) / total
    offsets = (points - centre).T
    offsets -= ((offsets * weights).sum(axis=1) / total)[:, None]
    scatter = offsets @ (offsets * weights).T * (1 / total)
    return Line(centre, np.linalg.eigh(scatter)[1][:, 1])


def angle_deg(first: Floats, second: Floats) -> float:
    """Return the angle between two unit vectors regardless of their signs, 0 to 90 degrees."""
    return math.degrees(math.acos(min(1.0, abs(float(first @ second)))))
