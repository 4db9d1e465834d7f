# SPDX-License-Identifier: Apache-2.0
"""A rule as a predictor: the result of the rule behind the gate."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.inference.rule_predictor import RulePredictor
from doorstate.rules import create_rule, list_rules
from doorstate.types import Points


def wall() -> Points:
    """Return (240, 320, 3) metres of a wall 3 m away and the floor 1 m below the camera."""
    across, up = np.meshgrid(np.linspace(0.58, -0.58, 320), np.linspace(0.43, -0.43, 240))
    depth_m = np.minimum(3.0, 1.0 / np.maximum(-up, 0.1))
    return (depth_m[..., None] * np.stack((np.ones_like(up), across, up), axis=-1)).astype(np.float32)


@pytest.mark.parametrize("name", list_rules())
def test_the_prediction_is_the_result_of_the_rule(name: str) -> None:
    result, prediction = create_rule(name)(wall()), RulePredictor.from_name(name)(wall())
    assert (prediction.state, prediction.reason, prediction.opening_angle_deg) == (
        result.state,
        result.reason,
        result.opening_angle_deg,
    )
    assert prediction.num_points == 320 * 240
    assert (prediction.probabilities, prediction.probability, prediction.raw_probabilities) == (
        None,
        None,
        None,
    )


@pytest.mark.parametrize("name", list_rules())
def test_the_gate_rejects_a_pane_of_glass(name: str) -> None:
    cloud = wall()
    cloud[:, 120:200] = np.nan
    prediction = RulePredictor.from_name(name)(cloud)
    assert prediction.state is None
    assert prediction.abstention is not None
    assert prediction.abstention.code == "door_hole"
    rule = create_rule(name)
    assert RulePredictor(rule, gate=None)(cloud).reason == rule(cloud).reason


def test_nothing_measured_is_unknown() -> None:
    prediction = RulePredictor.from_name("angle_bins")(np.full((10, 10, 3), np.nan, np.float32))
    assert (prediction.state, prediction.num_points) == (None, 0)
    assert prediction.abstention is not None
    assert prediction.abstention.code == "too_few_points"
