# SPDX-License-Identifier: Apache-2.0
"""Tests of doorstate.doorways.walls."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from doorstate.doorways import walls as module
from doorstate.doorways.walls import find_walls, occupied_cells
from tests.doorways import plain_walls


def _wall_points(
    yaw_deg: float, distance_m: float, first_m: float, last_m: float, seed: int = 0, noise_m: float = 0.003
) -> np.ndarray:
    """Return points (N, 3) of a wall 2 m high; a wall straight ahead has yaw 90."""
    rng = np.random.default_rng(seed)
    yaw = np.radians(yaw_deg)
    along, normal = np.array([np.cos(yaw), np.sin(yaw)]), np.array([np.sin(yaw), -np.cos(yaw)])
    places = rng.uniform(first_m, last_m, (6000, 1))
    plan = distance_m * normal + places * along + rng.normal(0, noise_m, (6000, 1)) * normal
    return np.column_stack([plan, rng.uniform(-1, 1, 6000)])


@given(st.floats(30, 150), st.floats(0.8, 4.0))
def test_a_wall_is_found_where_it_stands(yaw_deg: float, distance_m: float) -> None:
    wall, *others = find_walls(_wall_points(yaw_deg, distance_m, -0.8, 1.5))
    assert wall.yaw_deg == pytest.approx(yaw_deg, abs=0.3)
    assert wall.distance_m == pytest.approx(distance_m, abs=0.01)
    assert (wall.first_m, wall.last_m) == pytest.approx((-0.8, 1.5), abs=0.06)
    assert wall.area_m2 == pytest.approx(2.3 * 2.0, rel=0.3)
    assert not others


def test_a_leaf_deeper_than_its_wall_does_not_turn_it() -> None:
    left, leaf, right = (
        _wall_points(90, distance_m, first_m, last_m, seed)
        for seed, (distance_m, first_m, last_m) in enumerate(
            [(2.0, 0.45, 1.2), (2.09, -0.45, 0.45), (2.0, -0.8, -0.45)]
        )
    )
    walls = find_walls(np.concatenate([left, leaf, right]))
    assert [wall.yaw_deg for wall in walls] == pytest.approx([90, 90], abs=0.5)
    assert sorted(wall.distance_m for wall in walls) == pytest.approx([2.0, 2.09], abs=0.01)


def test_walls_of_a_corridor_are_two() -> None:
    sides = np.concatenate([_wall_points(0.0, -0.9, 0.8, 4.0), _wall_points(0.0, 0.9, 0.8, 4.0)])
    walls = find_walls(sides)
    assert sorted(round(wall.yaw_deg) % 360 for wall in walls) == [0, 180]
    assert [wall.distance_m for wall in walls] == pytest.approx([0.9, 0.9], abs=0.01)


def test_chairs_and_a_single_point_are_no_walls() -> None:
    chair = _wall_points(90, 2.0, -0.2, 0.2)
    chair = chair[chair[:, 2] < -0.6]
    assert find_walls(chair) == []
    assert find_walls(chair[:1]) == []
    assert find_walls(np.empty((0, 3))) == []


def test_cells_count_height_not_points() -> None:
    places_m, heights_m = occupied_cells(_wall_points(90, 2.0, 0.0, 0.5))
    assert len(places_m) == len(heights_m)
    assert heights_m.max() == pytest.approx(2.0, abs=0.11)


def test_cells_equal_those_of_a_loop_over_all_points() -> None:
    points = np.concatenate([_wall_points(70, 2.0, 0.0, 0.9), _wall_points(95, 3.0, -1.0, 0.4, seed=1)])
    places_m, heights_m = occupied_cells(points)
    plain_m, plain_heights_m = plain_walls.occupied_cells(points)
    assert heights_m.tolist() == plain_heights_m.tolist()
    np.testing.assert_allclose(places_m, plain_m, rtol=0, atol=1e-9)


@given(st.integers(3, 30), st.integers(0, 1000))
def test_columns_of_a_wall_equal_those_of_a_loop_over_all_pairs(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    s = np.arange(count) * 0.05 - 0.7
    d = rng.choice([0.0, 0.06], count) + 0.1 * s + rng.normal(0, 0.004, count)
    best = module._best_columns(s, d)
    plain = plain_walls.best_columns(s, d)
    assert (np.zeros(count, dtype=bool) if best is None else best).tolist() == plain.tolist()


def test_columns_have_the_median_depth_of_their_points() -> None:
    rng = np.random.default_rng(0)
    along_m, behind_m = rng.uniform(-1, 1, 900), rng.uniform(-0.12, 0.12, 900)
    middles_m, depths_m = module._columns(along_m, behind_m)
    number = ((along_m - along_m.min()) / 0.05).astype(int)
    for middle_m, depth_m in zip(middles_m, depths_m, strict=True):
        own = np.sort(behind_m[number == round((middle_m - along_m.min()) / 0.05 - 0.5)])
        assert depth_m == own[len(own) // 2]
    assert len(middles_m) == 40
