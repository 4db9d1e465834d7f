# SPDX-License-Identifier: Apache-2.0
"""Tests of doorstate.doorways.leaf_sweep on surfaces that are written down."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.doorways.doorway import Doorway
from doorstate.doorways.leaf_sweep import SEMI_OPEN_ANGLES_DEG, _counts, _widened, sweep_leaf
from doorstate.doorways.measured_view import MeasuredView


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


def test_cells_of_a_leaf_are_counted_by_part() -> None:
    rng = np.random.default_rng(0)
    cells, parts = rng.random((2, 2, 7, 10, 8)) < 0.5, rng.random((3, 10, 8)) < 0.4
    plain = [(cells & part).sum(axis=(-2, -1)) for part in parts]
    assert (_counts(cells, parts) == np.stack(plain)).all()


def test_walls_take_the_angles_beside_them() -> None:
    is_wall = np.random.default_rng(0).random((2, 2, 24)) < 0.1
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(is_wall, ((0, 0), (0, 0), (2, 2))), 5, axis=-1)
    assert (_widened(is_wall) == windows.any(axis=-1)).all()
