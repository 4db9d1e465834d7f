# SPDX-License-Identifier: Apache-2.0
"""Directions that planes allow as up are weighed against each other."""

from __future__ import annotations

import math

import numpy as np
import pytest

from doorstate.clouds.up_directions import _axes, face_one_way, up_directions
from doorstate.clouds.vertical import LevelingRefusal, Vertical, find_vertical
from doorstate.clouds.view_planes import ViewPlane

SAMPLE = np.array([[2.0, 0.0, -1.0], [2.0, 0.0, 1.0], [3.0, 0.5, 0.0]] * 40, np.float32)


def plane(
    x: float, y: float, z: float, distance_m: float = 2.0, share: float = 0.3, error: float = 0.1
) -> ViewPlane:
    normal = np.array([x, y, z])
    return ViewPlane(normal / np.linalg.norm(normal), distance_m, share, error)


FLOOR, WALL, SIDE = plane(0, 0, -1, 1.0), plane(1, 0, 0, 3.0), plane(0, 1, 0)


def test_axes_of_a_room() -> None:
    axes = [abs(direction.axis) for direction in up_directions([FLOOR, WALL, plane(1, 1, 0)])]
    assert axes[0] == pytest.approx([0, 0, 1], abs=1e-9)
    three = up_directions([FLOOR, WALL, SIDE])
    assert sorted(int(np.argmax(abs(direction.axis))) for direction in three) == [1, 2]


def test_error_grows_with_noise_and_disagreement() -> None:
    exact, noisy, bent = (
        up_directions(planes)[0].error_deg
        for planes in (
            [FLOOR, WALL, plane(1, 1, 0)],
            [plane(0, 0, -1, error=1.0), plane(1, 0, 0, error=1.0), plane(1, 1, 0, error=1.0)],
            [FLOOR, plane(1, 0, math.tan(math.radians(2.5))), plane(1, 1, 0)],
        )
    )
    assert exact < 0.6 < noisy
    assert exact < bent


def test_weak_walls_are_unsure() -> None:
    """The line in which two walls meet at 25 degrees is inexact if one of them is small and noisy."""
    narrow = plane(1, math.tan(math.radians(25)), 0, share=0.02, error=1.5)
    found = find_vertical([plane(1, 0, 0, share=0.7), narrow], SAMPLE)
    assert isinstance(found, LevelingRefusal)
    assert found.code == "tilt_unsure"
    assert found.values["error_deg"] > found.values["max_error_deg"]


def test_steep_views_are_refused() -> None:
    tilted = [plane(0.71, across, 0.69) for across in (-0.19, 0.19)]
    assert not face_one_way(tilted)
    found = find_vertical(tilted, SAMPLE)
    assert isinstance(found, LevelingRefusal)
    assert found.code == "tilt_too_steep"


def test_surfaces_aslant_tell_directions_apart() -> None:
    found = find_vertical([WALL, SIDE, plane(1, 0.7, 0)], SAMPLE)
    assert isinstance(found, Vertical)
    assert abs(found.up[2]) == pytest.approx(1)
    assert not found.shows_floor
    unclear = find_vertical([WALL, plane(0, 1, 0, 0.8, share=0.7)], SAMPLE)
    assert isinstance(unclear, LevelingRefusal)
    assert unclear.values["probability"] < unclear.values["min_probability"]


def test_known_height_is_evidence() -> None:
    """A plane 0.4 m below and one 2 m above could change places, unless the height is known."""
    planes = [plane(0, 0, -1, 2.0), plane(0, 0, 1, 0.7), WALL, plane(1, 0.7, 0)]
    found = find_vertical(planes, SAMPLE, camera_height_m=0.7)
    assert isinstance(found, Vertical)
    assert found.up[2] == pytest.approx(-1)
    other = find_vertical(planes, SAMPLE, camera_height_m=2.0)
    assert isinstance(other, Vertical)
    assert other.up[2] == pytest.approx(1)


def test_axes_equal_those_of_a_loop_over_pairs() -> None:
    for count in (1, 2, 10):
        normals = np.random.default_rng(count).normal(size=(count, 3))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        plain = list(normals)
        for number in range(count):
            for other in range(number):
                line = np.cross(normals[number], normals[other])
                length = np.linalg.norm(line)
                plain += [line / length] if length > math.sin(math.radians(20)) else []
        assert (_axes(normals) == np.array(plain)).all()
