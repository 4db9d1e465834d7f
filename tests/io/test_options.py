# SPDX-License-Identifier: Apache-2.0
"""Impossible reading options, and their fields."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from doorstate.errors import CameraError, ConfigError
from doorstate.io.camera import Pinhole
from doorstate.io.options import ReadOptions, metres_per_unit


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"roll_deg": 361}, "roll_deg"),
        ({"pitch_deg": 90.5}, "pitch_deg"),
        ({"pitch_deg": np.nan}, "pitch_deg"),
        ({"camera_height_m": 0.0}, "camera_height_m"),
        ({"camera_height_m": -1.0}, "camera_height_m"),
        ({"camera_height_m": 26.0}, "camera_height_m"),
        ({"camera_height_m": np.nan}, "camera_height_m"),
        ({"axes": "sideways"}, "axes"),
        ({"axes": "flf"}, "axes"),
        ({"axes": "rfd"}, "axes"),
        ({"quaternion": (0.0, 0.0, 0.0, 0.5)}, "quaternion"),
        ({"quaternion": (0.0, 0.0, 0.0, 1.0), "pitch_deg": 3.0}, "quaternion"),
        ({"units_m": 0.0}, "units_m"),
        ({"units_m": np.nan}, "units_m"),
        ({"depth_scale_m": np.nan}, "depth_scale_m"),
        ({"depth_scale_m": -0.001}, "depth_scale_m"),
        ({"intrinsics": Pinhole(-5, 5, 2, 2)}, "fx"),
        ({"intrinsics": "camera.yaml"}, "intrinsics"),
    ],
)
def test_impossible_options_are_camera_errors(options: dict[str, Any], field: str) -> None:
    with pytest.raises(CameraError) as caught:
        ReadOptions(**options)
    assert caught.value.field == field


def test_metres_per_unit() -> None:
    assert metres_per_unit("mm") == 0.001
    with pytest.raises(ConfigError) as caught:
        metres_per_unit("inch")
    assert caught.value.field == "units"


def test_tilt_is_known_if_it_was_given_as_zero_too() -> None:
    assert not ReadOptions().pose().is_tilt_known
    assert not ReadOptions(camera_height_m=1.0).pose().is_tilt_known
    for options in (
        ReadOptions(pitch_deg=0.0),
        ReadOptions(roll_deg=0.0),
        ReadOptions(quaternion=(0, 0, 0, 1)),
    ):
        pose = options.pose()
        assert pose.is_tilt_known
        assert (pose.roll_deg, pose.pitch_deg) == (0, 0)


def test_height_of_the_camera_goes_with_its_pose() -> None:
    pose = ReadOptions(camera_height_m=0.8, pitch_deg=5).pose()
    assert pose.camera_height_m == 0.8
    assert pose.to_dict()["camera_height_m"] == 0.8
    assert "camera_height_m" not in ReadOptions().pose().to_dict()
