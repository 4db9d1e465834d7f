# SPDX-License-Identifier: Apache-2.0
"""Rules that tell the state of a door without training: reconstructed related work and two plain baselines."""

from __future__ import annotations

from typing import Any

from doorstate.errors import unknown_name
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
    """Return the names of all rules."""
    return list(RULES)


def create_rule(name: str) -> Rule[Any]:
    """Create a rule with its default parameters.

    Raises:
        ConfigError: no such rule.
    """
    if name not in RULES:
        raise unknown_name("rule", name, list(RULES))
    return RULES[name]()
