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
