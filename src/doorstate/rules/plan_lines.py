# SPDX-License-Identifier: Apache-2.0
"""Upright surfaces as straight lines in plan view: a robust fit of many trials at once."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_PAIRS = 400  # a surface with a fifth of the points is hit by 16 of them
_REFITS = 3


@dataclass(frozen=True, eq=False)
class Line:
    """A line in plan view through `centre` (2,) metres along the unit vector `direction` (2,)."""

    centre: Floats
    direction: Floats

    @property
    def normal(self) -> Floats:
        """Unit vector (2,) across the line, away from the camera."""
        normal = np.array([-self.direction[1], self.direction[0]])
        return normal if normal @ self.centre >= 0 else -normal

    def along_m(self, points: Floats) -> Floats:
        """(N,) places of (N, 2) points along the line, from its centre."""
        along: Floats = (points - self.centre) @ self.direction
        return along

    def behind_m(self, points: Floats) -> Floats:
        """(N,) distances of (N, 2) points; positive behind the line as the camera sees it."""
        behind: Floats = (points - self.centre) @ self.normal
        return behind

    def at(self, along_m: float) -> Floats:
        """The point (2,) of the line at a place."""
        place: Floats = self.centre + along_m * self.direction
        return place

    def foot(self, point: Floats) -> Floats:
        """The nearest point (2,) of the line to a point (2,)."""
        return self.at(float(self.along_m(point)))

    def crossing(self, other: Line) -> Floats:
        """Where two lines meet (2,); they must not be parallel."""
        axes = np.stack([self.direction, -other.direction], axis=1)
        return self.at(float(np.linalg.solve(axes, other.centre - self.centre)[0]))

    def angle_deg(self, other: Line) -> float:
        """Angle between two lines, 0 to 90."""
        return angle_deg(self.direction, other.direction)


def strongest_line(
    points: Floats, threshold_m: float, weights: Floats | None = None, *, seed: int = 0
) -> tuple[Line, Flags] | None:
    """The line with most points (or weight) within a distance, and which points (N,) these are.

    Args:
        points: (N, 2) metres.
        threshold_m: how far a point of the line may be from it.
        weights: (N,) how much each point counts; all the same if None.
        seed: of the pairs of points that are tried.

    Returns:
        None of fewer than two distinct points.
    """
    if len(points) < 2:
        return None
    weights = np.ones(len(points)) if weights is None else weights
    first, second = np.random.default_rng(seed).integers(len(points), size=(2, _PAIRS))
    axes = points[second] - points[first]
    lengths_m = np.hypot(*axes.T)
    apart = lengths_m > 2 * threshold_m  # nearer ones point anywhere
    if not apart.any():
        return None
    axes = axes[apart] / lengths_m[apart, None]
    normals = np.stack([-axes[:, 1], axes[:, 0]], axis=1)
    offsets = (normals * points[first[apart]]).sum(axis=1)
    near = np.abs(points @ normals.T - offsets) <= threshold_m  # (N, pairs)
    on_line: Flags = near[:, np.argmax(weights @ near)]
    for _ in range(_REFITS):
        line = fit_line(points[on_line], weights[on_line])
        refitted = np.abs(line.behind_m(points)) <= threshold_m
        if np.count_nonzero(refitted) < 2:
            break
        on_line = refitted
    return line, on_line


def fit_line(points: Floats, weights: Floats | None = None) -> Line:
    """The line of least squared distances to (N, 2) points."""
    centre = np.average(points, axis=0, weights=weights)
    scatter = np.cov((points - centre).T, aweights=weights, ddof=0)
    return Line(centre, np.linalg.eigh(scatter)[1][:, 1])


def angle_deg(one: Floats, other: Floats) -> float:
    """Angle between two directions regardless of their signs, 0 to 90 degrees."""
    return math.degrees(math.acos(min(1.0, abs(float(one @ other)))))
