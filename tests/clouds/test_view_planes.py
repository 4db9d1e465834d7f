# SPDX-License-Identifier: Apache-2.0
"""Planes of a view are found with their normals, distances and errors."""

from __future__ import annotations

import math

import numpy as np
import pytest

from doorstate.clouds.view_planes import find_planes, sample_ahead
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.presets import PRESETS

from .boxes_in_view import FLOOR, measure, wall


@pytest.mark.parametrize("flat", [False, True])
def test_floor_and_walls(flat: bool) -> None:
    cloud = measure([FLOOR, wall(3.0), wall(1.2, 90)], pitch_deg=20)
    planes = find_planes(sample_ahead(cloud.reshape(-1, 3) if flat else cloud))
    assert len(planes) == 3
    assert sorted(plane.distance_m for plane in planes) == pytest.approx([1.0, 1.2, 3.0], abs=0.01)
    assert [plane.share for plane in planes] == sorted((plane.share for plane in planes), reverse=True)
    floor = min(planes, key=lambda plane: plane.distance_m)
    tilt = math.radians(20)
    assert floor.normal == pytest.approx([math.sin(tilt), 0, -math.cos(tilt)], abs=0.003)
    assert all(plane.error_deg < 0.3 for plane in planes)


def test_error_covers_the_noise_of_a_sensor() -> None:
    _, frames = simulate_rows(PRESETS["varied"], 5, 2, "xtion")
    planes = find_planes(sample_ahead(frames[0].points))
    assert planes
    for plane in planes:
        elevation_deg = math.degrees(math.asin(abs(plane.normal[2])))
        off_deg = min(elevation_deg, 90 - elevation_deg)
        assert off_deg < 0.5 + 3 * plane.error_deg


def test_only_measured_points_ahead_are_sampled() -> None:
    cloud = np.array([[1, 0, 0], [-1, 0, 0], [np.nan, 0, 0], [1, 3, 0], [0, 0, 0], [20, 0, 0]], np.float32)
    assert sample_ahead(cloud).tolist() == [[1, 0, 0]]
    assert find_planes(sample_ahead(cloud)) == []
    assert find_planes(np.empty((0, 3), np.float32)) == []
