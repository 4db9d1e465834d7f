# SPDX-License-Identifier: Apache-2.0
"""Folders of the ROS packages."""

from __future__ import annotations

from pathlib import Path

ROS2 = Path(__file__).resolve().parents[2] / "ros2"
PACKAGE = ROS2 / "doorstate_ros"
