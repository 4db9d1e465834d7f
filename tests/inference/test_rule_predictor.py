# SPDX-License-Identifier: Apache-2.0
"""A rule behind a predictor's interface: the same answer, the same gate."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.inference.rule_predictor import RulePredictor
from doorstate.rules import create_rule, list_rules
from doorstate.types import STATES, Points


def wall() -> Points:
    """A wall 3 m away across the view and the floor 1 m below the camera, (240, 320, 3)."""
    across, up = np.meshgrid(np.linspace(0.58, -0.58, 320), np.linspace(0.43, -0.43, 240))
    depth_m = np.minimum(3.0, 1.0 / np.maximum(-up, 0.1))
    return (depth_m[..., None] * np.stack((np.ones_like(up), across, up), axis=-1)).astype(np.float32)


@pytest.mark.parametrize("name", list_rules())
def test_says_what_its_rule_says(name: str) -> None:
    answer, said = create_rule(name)(wall()), RulePredictor.from_name(name)(wall())
    assert (said.state, said.reason, said.opening_angle_deg) == (
        answer.state,
        answer.reason,
        answer.opening_angle_deg,
    )
    assert said.num_points == 320 * 240
    assert said.probabilities == {
        state: float(answer.state is not None and state == answer.state.label) for state in STATES
    }


@pytest.mark.parametrize("name", list_rules())
def test_a_pane_of_glass_is_refused_by_the_gate(name: str) -> None:
    cloud = wall()
    cloud[:, 120:200] = np.nan
    said = RulePredictor.from_name(name)(cloud)
    assert said.state is None
    assert said.abstention is not None
    assert said.abstention.code == "hole"
    rule = create_rule(name)
    assert RulePredictor(rule, gate=None)(cloud).reason == rule(cloud).reason


def test_nothing_measured_is_unknown() -> None:
    said = RulePredictor.from_name("angle_bins")(np.full((10, 10, 3), np.nan, np.float32))
    assert (said.state, said.num_points) == (None, 0)
    assert said.abstention is not None
    assert said.abstention.code == "too_few_points"
