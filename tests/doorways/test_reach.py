# SPDX-License-Identifier: Apache-2.0
"""Tests of doorstate.doorways.reach."""

from __future__ import annotations

import numpy as np

from doorstate.doorways.doorway import Doorway
from doorstate.doorways.reach import Reach


def _plain(points: np.ndarray, places: np.ndarray, heights_m: np.ndarray) -> np.ndarray:
    """Return which places are reached by one loop over all points."""
    farthest: dict[tuple[int, int], float] = {}
    for x, y, z in points.astype(np.float64):
        if x > 0.05:
            cell = int(np.floor((y / x + 2) / 0.05)), int(np.floor((z / x + 2) / 0.05))
            farthest[cell] = max(farthest.get(cell, 0.0), x)
    reached = np.zeros((len(places), len(heights_m)), dtype=bool)
    for row, (x, y, _) in enumerate(places.astype(np.float64)):
        for column, z in enumerate(heights_m.tolist()):
            cell = int(np.floor((y / x + 2) / 0.05)), int(np.floor((z / x + 2) / 0.05))
            is_inside = x > 0.05 and min(cell) >= 0 and max(cell) < 80
            reached[row, column] = is_inside and farthest.get(cell, 0.0) > x - 0.15
    return reached


def test_reach_equals_a_loop_over_all_points() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform((-1, -4, -1), (5, 4, 2), (3000, 3)).astype(np.float32)
    places = Doorway(2.0, 0.4, 80.0, 0.9, -1.0).to_sensor(rng.uniform(-3, 3, (300, 3)).astype(np.float32))
    places = places[np.abs(places[:, 0]) > 0.01]
    heights_m = np.linspace(-1, 1.5, 8, dtype=np.float32)
    found = Reach.of(np.ascontiguousarray(points.T)).includes(places, heights_m)
    plain = _plain(points, places, heights_m)
    # A tangent on an edge of a cell may fall on either side in float32.
    assert (found != plain).sum() <= 3
    assert 0.1 < plain.mean() < 0.9
