# SPDX-License-Identifier: Apache-2.0
"""Clouds of tilted cameras are turned level by the tilt that is given."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.clouds.leveling import level_cloud
from doorstate.errors import CloudContentError

from .boxes_in_view import FLOOR, measure, wall

ROOM = [FLOOR, wall(3.0), wall(1.2, 90)]


def test_a_tilt_of_zero_changes_no_bit() -> None:
    cloud = measure(ROOM)
    leveling = level_cloud(cloud, roll_deg=0.0, pitch_deg=0.0)
    assert leveling.points is cloud
    assert (leveling.source, leveling.refusal, leveling.error_deg) == ("given", None, None)
    assert leveling.floor_z_m == pytest.approx(-1.0, abs=0.01)


def test_given_tilt_is_applied() -> None:
    cloud = measure(ROOM, pitch_deg=25, roll_deg=-90)
    leveling = level_cloud(cloud, roll_deg=-90, pitch_deg=25)
    assert leveling.points.dtype == cloud.dtype
    assert leveling.points.shape == cloud.shape
    assert (leveling.roll_deg, leveling.pitch_deg) == pytest.approx((-90, 25))
    assert leveling.floor_z_m == pytest.approx(-1.0, abs=0.01)
    assert np.nanmin(leveling.points[..., 2]) == pytest.approx(-1.0, abs=0.01)


def test_one_given_angle_leaves_the_other_at_zero() -> None:
    cloud = measure(ROOM, pitch_deg=10)
    assert level_cloud(cloud, pitch_deg=10).roll_deg == 0
    assert level_cloud(cloud, roll_deg=180).pitch_deg == 0


def test_known_height_is_the_floor_where_none_is_seen() -> None:
    leveling = level_cloud(measure([wall(1.5)]), pitch_deg=0.0, camera_height_m=1.1)
    assert leveling.floor_z_m == -1.1


def test_whole_numbers_are_turned_too() -> None:
    millimetres = np.round(measure(ROOM, pitch_deg=25) * 1000)
    cloud = np.where(np.isfinite(millimetres), millimetres, 0).astype(np.int64)
    assert level_cloud(cloud, pitch_deg=25).points.dtype.kind == "f"


def test_no_cloud_is_refused() -> None:
    with pytest.raises(CloudContentError):
        level_cloud(np.zeros((5, 4), np.float32))
