# SPDX-License-Identifier: Apache-2.0
"""Rules that tell the state of a door without training: reconstructed related work and two plain baselines.

Importing this package imports no rule and no SciPy: a rule's module is loaded when the rule is first needed.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, cast

from doorstate.errors import unknown_name

if TYPE_CHECKING:
    from doorstate.rules.base import Rule

RULES = {
    "open_door": "doorstate.rules.open_door:OpenDoorRule",
    "plane_state": "doorstate.rules.plane_state:PlaneStateRule",
    "wall_leaf_angle": "doorstate.rules.wall_leaf_angle:WallLeafAngleRule",
    "angle_bins": "doorstate.rules.angle_bins:AngleBinsRule",
    "depth_region": "doorstate.rules.depth_region:DepthRegionRule",
}
"""Rules by name, as module:class."""


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
    module, _, class_name = RULES[name].partition(":")
    return cast("Rule[Any]", getattr(import_module(module), class_name)())
