# SPDX-License-Identifier: Apache-2.0
"""The floor of a level cloud is found, table tops and the lower ends of walls are not."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.clouds.floor import find_floor_z_m
from doorstate.io.rotations import rotate, tilt_matrix
from doorstate.types import Points

from .boxes_in_view import FLOOR, measure, table, wall


def level(cloud: Points, pitch_deg: float) -> Points:
    return rotate(cloud, np.array(tilt_matrix(0.0, pitch_deg))).astype(np.float32)


@pytest.mark.parametrize("height_m", [0.2, 0.6, 1.0, 1.7])
@pytest.mark.parametrize("distance_m", [2.5, 5.0])
def test_floor_is_found(height_m: float, distance_m: float) -> None:
    cloud = level(
        measure([FLOOR, wall(distance_m), wall(1.2, 90)], height_m=height_m, pitch_deg=20), pitch_deg=20
    )
    assert find_floor_z_m(cloud) == pytest.approx(-height_m, abs=0.01)


@pytest.mark.parametrize("error_deg", [-1.5, 1.5])
def test_floor_is_found_with_a_small_error_of_the_tilt(error_deg: float) -> None:
    cloud = level(measure([FLOOR, wall(3.0)], pitch_deg=20), pitch_deg=20 + error_deg)
    assert find_floor_z_m(cloud) == pytest.approx(-1.0, abs=0.06)


def test_table_is_not_the_floor() -> None:
    with_floor = level(measure([FLOOR, wall(3.0), table(1.6)], height_m=1.3, pitch_deg=25), pitch_deg=25)
    assert find_floor_z_m(with_floor) == pytest.approx(-1.3, abs=0.01)
    hidden = level(measure([wall(3.0), table(1.2)], height_m=1.3, pitch_deg=15), pitch_deg=15)
    assert (hidden[..., 2] < -1.0).any()
    assert find_floor_z_m(hidden) is None


@pytest.mark.parametrize("distance_m", [0.5, 1.5, 2.5])
def test_walls_alone_have_no_floor(distance_m: float) -> None:
    assert find_floor_z_m(measure([wall(distance_m), wall(1.0, 90)], height_m=1.6)) is None


def test_known_height_picks_the_floor() -> None:
    boxes = [FLOOR, wall(3.0), table(1.6)]
    cloud = level(measure(boxes, height_m=1.3, pitch_deg=25), pitch_deg=25)
    assert find_floor_z_m(cloud, 0.58) == pytest.approx(-0.58, abs=0.01)
    assert find_floor_z_m(cloud, 1.35) == pytest.approx(-1.3, abs=0.01)
    assert find_floor_z_m(measure([wall(1.5)]), 1.2) == -1.2


def test_missing_points_are_left_out() -> None:
    cloud = level(measure([FLOOR, wall(3.0)], pitch_deg=20), pitch_deg=20)
    cloud[::3] = np.nan
    cloud[1::9] = np.inf
    cloud[2::9] = 0
    assert find_floor_z_m(cloud) == pytest.approx(-1.0, abs=0.01)
    assert find_floor_z_m(np.full((4, 3), np.nan, np.float32)) is None
    assert find_floor_z_m(np.empty((0, 3), np.float32)) is None


def test_a_point_that_rounds_to_the_edge_of_the_cells_is_no_error() -> None:
    floor = np.full((100, 3), [5.99, 3.6, -1.0], np.float32)
    assert find_floor_z_m(floor) is None
