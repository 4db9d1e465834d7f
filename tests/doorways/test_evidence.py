# SPDX-License-Identifier: Apache-2.0
"""Tests of doorstate.doorways.evidence and of the sweep of leaves."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from doorstate.doorways.doorway import Doorway
from doorstate.doorways.evidence import _pooled, find_evidence
from doorstate.doorways.expected_lines import row_density
from doorstate.doorways.finder import thinned
from doorstate.doorways.leaf_sweep import SEMI_OPEN_ANGLES_DEG, _counts, _widened, sweep_leaf
from doorstate.doorways.measured_view import MeasuredView
from tests.doorways import scenes
from tests.doorways.scenes import HandMade


def _doorway(made: HandMade) -> Doorway:
    true = made.doors[0]
    return Doorway(true.x_m, true.y_m, true.yaw_deg, true.width_m, made.floor_z_m)


@cache
def _dark() -> tuple[np.ndarray, Doorway]:
    made = scenes.dark_leaf()
    return thinned(made.points), _doorway(made)


def test_shares_of_an_opening_sum_to_one() -> None:
    for make in (scenes.dark_leaf, scenes.glass_leaf_seen_through, scenes.lower_leaf_from_near_the_floor):
        made = make()
        evidence = find_evidence(MeasuredView(thinned(made.points)), _doorway(made))
        total = evidence.on_wall + evidence.through + evidence.hidden + evidence.missing
        assert total == pytest.approx(1.0)
        assert 0 < evidence.in_view <= 1
        assert 0 <= evidence.flush <= 1
        assert evidence.nearest_m < evidence.rim_m < evidence.farthest_m


def test_a_dark_leaf_is_missing_and_the_floor_before_it_is_there() -> None:
    points, doorway = _dark()
    evidence = find_evidence(MeasuredView(points), doorway)
    assert evidence.missing > 0.8
    assert evidence.has_floor_before
    assert evidence.rim_m == pytest.approx(doorway.distance_m, abs=0.5)


def test_the_order_of_the_points_does_not_matter() -> None:
    points, doorway = _dark()
    shuffled = np.random.default_rng(0).permutation(points)
    first, second = (find_evidence(MeasuredView(cloud), doorway) for cloud in (points, shuffled))
    # Means of float32 depths, and samples for the ranges, depend on the order.
    for name in (
        "in_view",
        "on_wall",
        "through",
        "hidden",
        "missing",
        "flush",
        "rim_m",
        "hole_m",
        "nearest_m",
    ):
        assert getattr(second, name) == pytest.approx(getattr(first, name), abs=0.05, nan_ok=True)
    assert second.has_floor_before == first.has_floor_before


def test_points_far_beside_the_door_do_not_matter() -> None:
    points, doorway = _dark()
    near = points[np.abs(doorway.to_doorway(points)[:, 0]) < 1.3]
    full, cut = find_evidence(MeasuredView(points), doorway), find_evidence(MeasuredView(near), doorway)
    assert (cut.on_wall, cut.through, cut.hidden, cut.missing) == pytest.approx(
        (full.on_wall, full.through, full.hidden, full.missing), abs=0.05
    )


def test_a_wall_without_points_has_nothing_in_view() -> None:
    _, doorway = _dark()
    evidence = find_evidence(MeasuredView(np.array([[1.0, 9.0, 0.0]], np.float32)), doorway)
    assert (evidence.in_view, evidence.missing) == (0.0, 0.0)
    assert np.isnan(evidence.rim_m)


def _leaf(angle_deg: float, doorway: Doorway, beyond_m: float = 0.0, top_m: float = 2.0) -> np.ndarray:
    """Return points on a leaf that opens away from the camera about the left end, and on a wall behind it."""
    along, up = np.meshgrid(np.arange(0.02, doorway.width_m + beyond_m, 0.02), np.arange(0.02, top_m, 0.04))
    turn = np.radians(angle_deg)
    x = doorway.width_m / 2 - along * np.cos(turn)
    leaf = np.stack([x, -along * np.sin(turn), up], axis=-1).reshape(-1, 3)
    wall = np.stack(
        np.broadcast_arrays(np.arange(-3, 3, 0.04)[:, None], -3.0, np.arange(0, 2.4, 0.04)), axis=-1
    ).reshape(-1, 3)
    return doorway.to_sensor(np.concatenate([leaf, wall]).astype(np.float32))


@pytest.mark.parametrize("angle_deg", [70.0, 90.0, 110.0])
def test_a_leaf_is_found_at_its_angle(angle_deg: float) -> None:
    doorway = Doorway(2.5, -0.4, 90.0, 0.9, -1.0)
    leaf = sweep_leaf(MeasuredView(_leaf(angle_deg, doorway)), doorway)
    assert leaf is not None
    assert (leaf.hinge, leaf.swing, leaf.width_m) == ("left", "away", 0.9)
    assert leaf.angle_deg == pytest.approx(angle_deg, abs=5)
    assert leaf.share > 0.9


def test_a_leaf_that_is_half_open_is_none_of_an_open_door() -> None:
    doorway = Doorway(2.5, -0.4, 90.0, 0.9, -1.0)
    assert sweep_leaf(MeasuredView(_leaf(40.0, doorway)), doorway) is None
    half_open = sweep_leaf(MeasuredView(_leaf(40.0, doorway)), doorway, SEMI_OPEN_ANGLES_DEG)
    assert half_open is not None
    assert half_open.angle_deg == pytest.approx(40, abs=5)


def test_a_wall_that_goes_on_is_no_leaf() -> None:
    doorway = Doorway(2.5, -0.4, 90.0, 0.9, -1.0)
    assert sweep_leaf(MeasuredView(_leaf(90.0, doorway, beyond_m=1.0)), doorway) is None
    assert sweep_leaf(MeasuredView(_leaf(90.0, doorway, top_m=2.5)), doorway) is None


@pytest.mark.parametrize("pool", [1, 2, 3])
def test_pooled_cells_equal_sums_of_padded_blocks(pool: int) -> None:
    for shape in ((1, 1), (7, 5), (9, 6), (8, 19)):
        cells = np.random.default_rng(0).integers(0, 9, shape).astype(np.float64)
        columns, rows = (-(-size // pool) for size in shape)
        padded = np.pad(cells, ((0, columns * pool - shape[0]), (0, rows * pool - shape[1])))
        plain = padded.reshape(columns, pool, rows, pool).sum(axis=(1, 3))
        assert (_pooled(cells, pool) == plain).all()
        assert (_pooled(np.stack([cells, 2 * cells]), pool) == np.stack([plain, 2 * plain])).all()


def test_density_of_rows_equals_a_loop() -> None:
    rim = np.random.default_rng(0).poisson(0.4, (11, 19)).astype(np.float64)
    density = row_density(rim)
    for row in range(19):
        rows = [max(0, row - 1), row, min(18, row + 1)]
        about = [sum(column[rows]) / 3 for column in rim]
        filled = [value for value in about if value > 0]
        assert density[row] == pytest.approx(sum(filled) / len(filled) if len(filled) >= 2 else 0)


def test_cells_of_a_leaf_are_counted_by_part() -> None:
    rng = np.random.default_rng(0)
    cells, parts = rng.random((2, 2, 7, 10, 8)) < 0.5, rng.random((3, 10, 8)) < 0.4
    plain = [(cells & part).sum(axis=(-2, -1)) for part in parts]
    assert (_counts(cells, parts) == np.stack(plain)).all()


def test_walls_take_the_angles_beside_them() -> None:
    is_wall = np.random.default_rng(0).random((2, 2, 24)) < 0.1
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(is_wall, ((0, 0), (0, 0), (2, 2))), 5, axis=-1)
    assert (_widened(is_wall) == windows.any(axis=-1)).all()
