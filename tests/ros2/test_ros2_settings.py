# SPDX-License-Identifier: Apache-2.0
"""Parameters of the node without ROS: what they may be, and what changes while the node is active."""

from __future__ import annotations

from typing import Any

import pytest
from doorstate_ros.settings import LIVE, NodeSettings, changed_settings, parse_node_settings

from doorstate.errors import ConfigError


@pytest.mark.parametrize(
    ("parameters", "field"),
    [
        ({"gravity_frame": "odom", "pitch": 10.0}, "gravity_frame"),
        ({"history": "doors.sqlite"}, "history"),
        ({"doors": "doors.yaml", "map_frame": ""}, "map_frame"),
        ({"tf_timeout_s": -1.0}, "tf_timeout_s"),
        ({"map_fram": "map"}, "map_fram"),
    ],
)
def test_impossible_parameters_are_refused_by_name(parameters: dict[str, Any], field: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_node_settings(parameters)
    assert field in str(caught.value)


def test_transforms_are_looked_up_only_where_they_are_needed() -> None:
    assert not NodeSettings().uses_tf
    assert parse_node_settings({"gravity_frame": "odom"}).uses_tf
    assert parse_node_settings({"doors": "doors.yaml"}).uses_tf


def test_some_parameters_change_at_once_and_others_when_the_node_is_configured() -> None:
    settings = NodeSettings()
    assert changed_settings(settings, {"hold_s": 2.0, "pitch": 5.0}, is_configured=True).hold_s == 2.0
    with pytest.raises(ConfigError, match="network"):
        changed_settings(settings, {"network": "ogurob-pointnet"}, is_configured=True)
    changed = changed_settings(settings, {"network": "ogurob-pointnet"}, is_configured=False)
    assert changed.network == "ogurob-pointnet"
    assert changed_settings(settings, {"network": settings.network}, is_configured=True) == settings
    with pytest.raises(ConfigError, match="hold_s"):
        changed_settings(settings, {"hold_s": -1.0}, is_configured=True)
    assert set(NodeSettings.model_fields) > LIVE
