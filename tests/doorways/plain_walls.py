# SPDX-License-Identifier: Apache-2.0
"""Plain forms of the fits of walls, to compare the quick ones with."""

from __future__ import annotations

import math

import numpy as np

from doorstate.doorways.plan_lines import Line


def fit_line(points: np.ndarray, weights: np.ndarray | None = None) -> Line:
    """Return the line of least squares by NumPy's covariance."""
    centre = np.average(points, axis=0, weights=weights)
    scatter = np.cov((points - centre).T, aweights=weights, ddof=0)
    return Line(centre, np.linalg.eigh(scatter)[1][:, 1])


def occupied_cells(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the cells of `walls.occupied_cells` by a dictionary of points."""
    cells: dict[tuple[int, int], list[np.ndarray]] = {}
    low_x, low_y, low_z = points.min(axis=0)
    for point in points:
        cells.setdefault((int((point[0] - low_x) / 0.05), int((point[1] - low_y) / 0.05)), []).append(point)
    places, heights = [], []
    for _, inside in sorted(cells.items()):
        height_m = len({int((z - low_z) / 0.1) for _, _, z in inside}) * 0.1
        if height_m >= 0.5:
            places.append(np.mean(inside, axis=0)[:2])
            heights.append(height_m)
    return np.array(places).reshape(-1, 2), np.array(heights)


def best_columns(s: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return the columns near the line through two of them that most are near to, by a loop over all pairs."""
    best, best_gain = np.zeros(len(s), dtype=bool), 0.0
    for first in range(len(s)):
        for second in range(first + 1, len(s)):
            slope = (d[second] - d[first]) / (s[second] - s[first])
            if abs(slope) > math.tan(math.radians(8.0)):
                continue
            gains = np.maximum(1 - ((d - slope * s - (d[first] - slope * s[first])) / 0.015) ** 2, 0)
            if gains.sum() > best_gain:
                best, best_gain = gains > 0, gains.sum()
    return best
