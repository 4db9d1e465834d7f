# SPDX-License-Identifier: Apache-2.0
"""Door states from rules: the related work's methods, reconstructed, and two plain baselines, by name."""

from __future__ import annotations

from typing import Any

from doorstate.errors import ConfigError
from doorstate.rules.angle_bins import AngleBinsRule
from doorstate.rules.base import Rule
from doorstate.rules.depth_region import DepthRegionRule
from doorstate.rules.open_door import OpenDoorRule
from doorstate.rules.plane_state import PlaneStateRule
from doorstate.rules.wall_leaf_angle import WallLeafAngleRule

RULES: dict[str, type[Rule[Any]]] = {
    rule.name: rule
    for rule in (OpenDoorRule, PlaneStateRule, WallLeafAngleRule, AngleBinsRule, DepthRegionRule)
}


def list_rules() -> list[str]:
    """Names that `create_rule` knows."""
    return list(RULES)


def create_rule(name: str) -> Rule[Any]:
    """A rule with its default parameters.

    Raises:
        ConfigError: no such rule.
    """
    if name not in RULES:
        raise ConfigError(f"there is no rule {name!r}: known are {', '.join(RULES)}")
    return RULES[name]()
