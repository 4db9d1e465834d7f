# SPDX-License-Identifier: Apache-2.0
"""The ROS packages are not installed: their folders are on the path of these tests."""

from __future__ import annotations

import sys
from pathlib import Path

for package in ("doorstate_ros", "doorstate_nav"):
    sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "ros2" / package))
