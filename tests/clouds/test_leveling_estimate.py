# SPDX-License-Identifier: Apache-2.0
"""The tilt is told from floor and walls, or refused with a reason."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.clouds.leveling import Leveling, level_cloud
from doorstate.io.rotations import tilt_matrix
from doorstate.simulation.scene.box import Box
from doorstate.types import Part, Points

from .boxes_in_view import CAMERA, CEILING, FLOOR, measure, table, wall

LEAF = Box(Part.LEAF, (2.2, 0.6, 1.05), (0.04, 0.9, 2.1), math.radians(40))
ROOM = [FLOOR, wall(3.0), wall(1.4, 90), LEAF]
WIDE = CAMERA.model_copy(update={"hfov_deg": 100.0})


def error_deg(leveling: Leveling, pitch_deg: float, roll_deg: float) -> float:
    """Return the angle between the vertical that was found and the true one."""
    true_up = np.array(tilt_matrix(roll_deg, pitch_deg))[2]
    return math.degrees(math.acos(min(1.0, float(leveling.rotation[2] @ true_up))))


@settings(max_examples=40)
@given(st.floats(-5, 22), st.floats(-35, 35), st.floats(0.4, 1.2), st.sampled_from([(120, 160), (-1,)]))
def test_tilt_of_a_room_is_found(pitch: float, roll: float, height_m: float, shape: tuple[int, ...]) -> None:
    cloud = measure(ROOM, height_m=height_m, pitch_deg=pitch, roll_deg=roll).reshape(*shape, 3)
    leveling = level_cloud(cloud)
    assert leveling.refusal is None
    assert leveling.points.shape == cloud.shape
    assert error_deg(leveling, pitch, roll) < 0.3
    assert leveling.error_deg is not None
    assert 0 < leveling.error_deg < 1.5


def test_floor_and_source() -> None:
    leveling = level_cloud(measure(ROOM, pitch_deg=20, roll_deg=5))
    assert leveling.source == "floor"
    assert leveling.floor_z_m == pytest.approx(-1.0, abs=0.02)
    assert (leveling.pitch_deg, leveling.roll_deg) == pytest.approx((20, 5), abs=0.3)
    without = level_cloud(measure([wall(3.0), wall(0.8, 90), LEAF], pitch_deg=-10, roll_deg=5))
    assert without.source == "walls"
    assert error_deg(without, -10, 5) < 0.5
    assert without.floor_z_m is None


@pytest.mark.parametrize("roll_deg", [90, -90, 75, -110])
def test_camera_on_its_side(roll_deg: float) -> None:
    leveling = level_cloud(measure(ROOM, height_m=0.6, pitch_deg=10, roll_deg=roll_deg))
    assert leveling.refusal is None
    assert error_deg(leveling, 10, roll_deg) < 0.3


def test_camera_upside_down() -> None:
    """The floor is near, and a leaf aslant tells that the walls are no floor."""
    near_floor = measure(ROOM, height_m=0.3, roll_deg=180)
    assert error_deg(level_cloud(near_floor), 0, 180) < 0.3
    halfway = level_cloud(measure([FLOOR, CEILING, wall(3.5), LEAF], height_m=0.8, roll_deg=180, camera=WIDE))
    assert halfway.refusal is not None
    assert halfway.refusal.code == "tilt_upside_down"
    known = level_cloud(
        measure([FLOOR, CEILING, wall(3.5), LEAF], height_m=0.8, roll_deg=180, camera=WIDE),
        camera_height_m=0.8,
    )
    assert error_deg(known, 0, 180) < 0.3


def test_known_height_tells_floor_from_table() -> None:
    cloud = measure([FLOOR, wall(3.0), wall(1.4, 90), table(1.6)], height_m=1.3, pitch_deg=30)
    leveling = level_cloud(cloud, camera_height_m=1.3)
    assert leveling.floor_z_m == pytest.approx(-1.3, abs=0.02)


def test_floor_alone_needs_a_known_height() -> None:
    cloud = measure([FLOOR], height_m=0.9, pitch_deg=30, roll_deg=8)
    assert code(cloud) == "tilt_one_plane"
    leveling = level_cloud(cloud, camera_height_m=0.9)
    assert leveling.source == "floor"
    assert error_deg(leveling, 30, 8) < 0.3
    assert code(cloud, camera_height_m=1.4) == "tilt_one_plane"


def code(cloud: Points, camera_height_m: float | None = None) -> str | None:
    leveling = level_cloud(cloud, camera_height_m=camera_height_m)
    if leveling.refusal is None:
        return None
    assert leveling.points is cloud
    assert leveling.source is None
    assert leveling.error_deg is None
    assert all(math.isfinite(value) for value in leveling.refusal.values.values())
    return leveling.refusal.code


def test_reasons() -> None:
    assert code(np.full((120, 160, 3), np.nan, np.float32)) == "tilt_no_planes"
    assert code(np.empty((0, 3), np.float32)) == "tilt_no_planes"
    noise = np.random.default_rng(0).uniform(1, 4, (20_000, 3)).astype(np.float32)
    assert code(noise) == "tilt_no_planes"
    assert code(measure([wall(2.0)], pitch_deg=10)) == "tilt_one_plane"
    assert code(measure([wall(0.3)])) == "tilt_against_wall"
    # Walls at right angles without a floor: the wall beside a camera could be the floor below one on its side.
    assert code(measure([wall(2.0), wall(0.8, 90)], pitch_deg=-10)) == "tilt_ambiguous"


def test_broken_numbers_are_left_out() -> None:
    cloud = measure(ROOM, pitch_deg=15)
    cloud[::7] = np.nan
    cloud[1::7] = np.inf
    cloud[2::7] = np.finfo(np.float32).max
    assert error_deg(level_cloud(cloud), 15, 0) < 0.3
