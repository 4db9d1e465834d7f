# SPDX-License-Identifier: Apache-2.0
"""Parameters of the node: those of a watch, and of frames, doors with names and the life cycle. Needs no ROS."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import Field

from doorstate.errors import ConfigError
from doorstate.inference.watch_settings import WatchSettings, parse_settings_as

# Change while the node is active; all others when it is configured.
LIVE = frozenset(
    {
        "door_known",
        "door_pose",
        "door_box",
        "require_leaf",
        "axes",
        "roll",
        "pitch",
        "quaternion",
        "tilt",
        "camera_height",
        "units",
        "depth_scale",
        "max_hz",
        "hold_s",
        "tf_timeout_s",
    }
)


class NodeSettings(WatchSettings):
    """Parameters of the node; `ros2 param describe` shows their descriptions."""

    gravity_frame: str = Field(
        "",
        description="Level frame, such as base_footprint or odom: tf tells the tilt of the camera; empty: none.",
    )
    map_frame: str = Field("map", description="Frame of the list of doors, for doors with names.")
    doors: str = Field(
        "", description="List of doors with names (doors.yaml); needs transforms to map_frame."
    )
    ask_doors: bool = Field(
        False, description="Ask for doors of the list that are in view and were not found: slower."
    )
    position_error_m: float = Field(
        0.1, ge=0, lt=100, description="Standard error of the place of the camera in the map, in metres."
    )
    yaw_error_deg: float = Field(
        3.0, ge=0, lt=180, description="Standard error of the heading of the camera in the map, in degrees."
    )
    history: str = Field("", description="SQLite file for changes of the doors of the list; empty: none.")
    history_days: float = Field(365.0, gt=0, description="Days of changes that the history keeps.")
    tf_timeout_s: float = Field(0.1, ge=0, le=5, description="Longest time to wait for a transform.")
    autostart: bool = Field(
        True,
        description="Configure and activate the node at its start; false leaves it to a life cycle manager.",
    )

    @property
    def uses_tf(self) -> bool:
        """True if transforms are looked up."""
        return bool(self.gravity_frame or self.doors)


def parse_node_settings(parameters: Mapping[str, Any]) -> NodeSettings:
    """Return the settings with these parameters, the others by default.

    Raises:
        ConfigError: a parameter does not exist, or cannot have this value.
    """
    settings = parse_settings_as(NodeSettings, parameters)
    if settings.gravity_frame and (settings.roll or settings.pitch or settings.quaternion):
        raise ConfigError("give either gravity_frame or roll, pitch and quaternion", field="gravity_frame")
    if settings.history and not settings.doors:
        raise ConfigError("needs a list of doors", field="history")
    if settings.doors and not settings.map_frame:
        raise ConfigError("is needed for doors with names", field="map_frame")
    return settings


def changed_settings(
    settings: NodeSettings, changes: Mapping[str, Any], *, is_configured: bool
) -> NodeSettings:
    """Return the settings with changed parameters.

    Raises:
        ConfigError: a value is impossible, or the parameter counts only when the node is configured.
    """
    fixed = [name for name in changes if name not in LIVE and changes[name] != getattr(settings, name, None)]
    if is_configured and fixed:
        raise ConfigError("changes only while the node is unconfigured: clean it up first", field=fixed[0])
    return parse_node_settings(settings.model_dump() | dict(changes))
