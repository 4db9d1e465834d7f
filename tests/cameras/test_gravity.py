# SPDX-License-Identifier: Apache-2.0
"""Tilt of a camera from its accelerometer."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.cameras.gravity import GRAVITY_M_S2, GravityFilter, tilt_of
from doorstate.errors import CameraError
from doorstate.io.rotations import axes_matrix, tilt_matrix


def up_of(roll_deg: float, pitch_deg: float) -> tuple[float, float, float]:
    """Direction upwards in the optical frame, by the matrices that level a cloud."""
    level_from_optical = np.array(tilt_matrix(roll_deg, pitch_deg)) @ np.array(axes_matrix("rdf"))
    x, y, z = (level_from_optical.T @ [0, 0, 1]).tolist()
    return x, y, z


@pytest.mark.parametrize(("roll_deg", "pitch_deg"), [(0, 0), (5, 0), (-3, 12), (0, -20), (40, 30)])
def test_tilt_is_the_one_that_levels_the_cloud(roll_deg: float, pitch_deg: float) -> None:
    assert tilt_of(up_of(roll_deg, pitch_deg)) == pytest.approx((roll_deg, pitch_deg))


@pytest.mark.parametrize(("roll_deg", "pitch_deg"), [(90, 0), (180, 0), (0, 60), (0, -90)])
def test_a_lying_camera_is_refused(roll_deg: float, pitch_deg: float) -> None:
    with pytest.raises(CameraError):
        tilt_of(up_of(roll_deg, pitch_deg))


def test_a_shaken_camera_is_averaged_and_a_fast_one_is_left_out() -> None:
    rng = np.random.default_rng(1)
    gravity = GravityFilter()
    at_rest = GRAVITY_M_S2 * np.array(up_of(2, 10))
    for k in range(300):
        gravity.add(at_rest + rng.normal(0, 0.15, 3), k / 100)
        if k % 10 == 0:
            gravity.add(at_rest + np.array([0, 0, 8.0]), k / 100)  # a robot that brakes
    up = gravity.up(3.0)
    assert up is not None
    assert tilt_of(up) == pytest.approx((2, 10), abs=0.5)


def test_without_fresh_readings_there_is_no_direction() -> None:
    gravity = GravityFilter()
    assert gravity.up(0.0) is None
    for k in range(5):
        assert gravity.up(k / 10) is None
        gravity.add(np.array([0, -9.8, 0]), k / 10)
    assert gravity.up(0.5) == pytest.approx((0, -1, 0))
    assert gravity.up(10.0) is None
    gravity.add(np.array([0, 0, -9.8]), 20.0)  # turned meanwhile: the old ones are forgotten
    assert gravity.up(20.0) is None
    gravity.add(np.full(3, np.nan), 20.1)
    assert gravity.up(20.1) is None
