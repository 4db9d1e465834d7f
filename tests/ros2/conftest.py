# SPDX-License-Identifier: Apache-2.0
"""The ROS package is not installed: its folder is on the path of these tests."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "ros2" / "doorstate_ros"))
