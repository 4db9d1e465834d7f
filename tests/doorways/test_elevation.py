# SPDX-License-Identifier: Apache-2.0
"""Tests of doorstate.doorways.elevation."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.doorways.elevation import (
    COLUMN_M,
    NUM_ROWS,
    RELIEF_M,
    ROW_M,
    Elevation,
    SightLines,
    wall_elevation,
)
from doorstate.doorways.plan_lines import Line
from doorstate.doorways.walls import Wall

_AHEAD = Wall(Line(np.array([2.0, 0.0]), np.array([0.0, 1.0])), first_m=-1.0, last_m=1.0, area_m2=4.0)
_FLOOR_M = -1.0


def _plain(wall: Wall, points: np.ndarray, floor_z_m: float, elevation: Elevation) -> dict[str, np.ndarray]:
    """Return counts and mean depths by one loop over all points."""
    shape = elevation.on_wall.shape
    counts, sums = np.zeros((*shape, 3)), np.zeros((*shape, 3))
    for point in points.astype(np.float64):
        reach = point[:2] @ wall.line.normal
        if reach <= 0.05 * np.hypot(*point[:2]):
            continue
        crossing = point * wall.distance_m / reach
        column = int(np.floor((crossing[:2] @ wall.line.direction - elevation.first_m) / COLUMN_M))
        row = int(np.floor((crossing[2] - floor_z_m) / ROW_M))
        behind = reach - wall.distance_m
        kind = 1 if behind > RELIEF_M else 2 if behind < -RELIEF_M else 0
        if 0 <= column < shape[0] and 0 <= row < shape[1]:
            counts[column, row, kind] += 1
            sums[column, row, kind] += behind
    return {"counts": counts, "means": sums / np.maximum(counts, 1)}


@pytest.mark.parametrize("turn_deg", [0.0, 25.0, -60.0])
def test_the_elevation_equals_a_loop_over_all_points(turn_deg: float) -> None:
    turn = np.radians(turn_deg)
    normal, along = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    wall = Wall(Line(2.0 * normal, along), first_m=-1.2, last_m=0.7, area_m2=3.0)
    points = np.random.default_rng(0).uniform((-1, -4, -1), (5, 4, 2), (4000, 3)).astype(np.float32)
    elevation = wall_elevation(wall, SightLines.to(points), _FLOOR_M)
    plain = _plain(wall, points, _FLOOR_M, elevation)
    counts = np.stack([elevation.on_wall, elevation.through, elevation.hidden], axis=-1)
    means = np.stack([elevation.relief_m, elevation.behind_m, elevation.before_m], axis=-1)
    # A point on an edge of a cell may fall on either side in float32.
    assert np.abs(counts - plain["counts"]).sum() <= 4
    same = counts == plain["counts"]
    assert means[same] == pytest.approx(plain["means"][same], abs=1e-4)
    assert elevation.seen.sum() > 500


def test_points_before_on_and_behind_a_wall() -> None:
    # Sight lines to the middle of a cell, 1 m above the floor and 0.52 m to the left.
    cell = np.array([2.0, 0.52, 0.05], np.float32)
    points = np.stack([0.5 * cell, cell, 2.0 * cell])
    elevation = wall_elevation(_AHEAD, SightLines.to(points), _FLOOR_M)
    column, row = int((0.52 - elevation.first_m) / COLUMN_M), round(1.0 / ROW_M)
    assert elevation.on_wall.shape[1] == NUM_ROWS
    assert elevation.on_wall[column, row] == elevation.through[column, row] == 1
    assert elevation.hidden[column, row] == 1
    assert elevation.seen.sum() == 3
    assert elevation.behind_m[column, row] == pytest.approx(2.0, abs=1e-5)
    assert elevation.before_m[column, row] == pytest.approx(-1.0, abs=1e-5)
    assert elevation.positions_m[column] == pytest.approx(0.52, abs=COLUMN_M)


def test_a_wall_without_points_is_empty() -> None:
    elevation = wall_elevation(_AHEAD, SightLines.to(np.empty((0, 3), np.float32)), _FLOOR_M)
    assert elevation.seen.sum() == 0
