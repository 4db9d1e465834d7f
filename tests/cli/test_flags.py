# SPDX-License-Identifier: Apache-2.0
"""Python parameters as flags."""

from __future__ import annotations

from doorstate.cli.flags import format_flag
from doorstate.errors import ConfigError


def test_names_become_flags() -> None:
    assert format_flag("max_depth_m") == "--max-depth-m"
    assert format_flag("num_points", 128) == "--points 128"
    assert format_flag("roll_deg", 90) == "--roll 90"
    assert format_flag("camera_height_m", 0.8) == "--camera-height 0.8"
    assert format_flag("ignore_viewpoint", True) == "--ignore-viewpoint"


def test_errors_name_flags() -> None:
    error = ConfigError("too few", field="num_points", suggestions={"axes": "optical", "depth_scale_m": 0.1})
    line = error.describe(format_flag)
    assert "--points" in line
    assert "--axes optical --depth-scale 0.1" in line
