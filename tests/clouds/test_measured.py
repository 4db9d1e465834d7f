# SPDX-License-Identifier: Apache-2.0
"""Points that were not measured; signalling NaNs, which drivers write, warn nowhere."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.clouds.measured import is_measured, quiet_nans
from doorstate.inference.gate import DEFAULT_GATE
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.predictor import Predictor
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.rules import list_rules
from doorstate.types import Points
from tests.hand_made_clouds import image_of_a_rough_wall

_SIGNALLING = {
    "f2": (np.uint16, 0x7D00),
    "f4": (np.uint32, 0x7FA00000),
    "f8": (np.uint64, 0x7FF4000000000000),
}


def _with_signalling_nans(kind: str) -> Points:
    cloud = image_of_a_rough_wall(60, 80).astype(kind)
    bits, number = _SIGNALLING[kind]
    cloud.view(bits)[::7, ::5] = number
    return cloud


def test_measured_points() -> None:
    rows = [[1, 2, 3], [0, 0, 1], [0, 0, 0], [np.nan, 1, 1], [1, np.inf, 1], [1, 1, 1e7], [-1e7, 1, 1]]
    assert is_measured(np.array(rows)).tolist() == [True, True, False, False, False, False, False]


@pytest.mark.parametrize("kind", _SIGNALLING)
def test_signalling_nans_become_quiet(kind: str) -> None:
    cloud = _with_signalling_nans(kind)
    holes = np.isnan(cloud)
    quiet = quiet_nans(cloud)
    assert quiet.dtype == cloud.dtype
    np.testing.assert_array_equal(np.isnan(quiet), holes)
    np.testing.assert_array_equal(quiet[~holes], cloud[~holes])
    assert quiet_nans(quiet) is quiet
    if kind != "f2":  # coordinates of half precision are widened first
        assert (is_measured(cloud) == ~holes[..., 0]).all()
    float(quiet.astype(np.float64)[0, 0, 0]) + 1  # warns of a signalling NaN


@pytest.mark.parametrize("kind", _SIGNALLING)
@pytest.mark.parametrize("name", ["network", *list_rules()])
@pytest.mark.parametrize("organized", [True, False])
def test_no_method_warns_and_answers_are_those_of_quiet_nans(kind: str, name: str, organized: bool) -> None:
    predictor: Predictor = (
        NetworkPredictor.from_weights("ogurob-pointnet", num_points=128, gate=DEFAULT_GATE)
        if name == "network"
        else RulePredictor.from_name(name, gate=DEFAULT_GATE)
    )
    cloud = _with_signalling_nans(kind)
    quiet = np.where(np.isnan(cloud), np.nan, cloud).astype(kind)
    answers = [predictor(some if organized else some.reshape(-1, 3)) for some in (cloud, quiet)]
    assert answers[0].state == answers[1].state
    assert answers[0].probabilities == answers[1].probabilities
