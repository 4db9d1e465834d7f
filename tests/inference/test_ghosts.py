# SPDX-License-Identifier: Apache-2.0
"""Ghost points open no closed door: default network, rules and gate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from doorstate import Predictor
from doorstate.inference.gate import Gate
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.io.camera import Pinhole
from doorstate.io.options import ReadOptions
from doorstate.io.readers import read_cloud
from doorstate.rules import create_rule, list_rules
from doorstate.types import Points

FOLDER = Path(__file__).resolve().parents[1] / "fixtures" / "ghosts"
CAMERA = Pinhole(554.256, 554.256, 319.5, 239.5)


@pytest.fixture(params=sorted(path.name for path in FOLDER.glob("*.png")))
def cloud(request: pytest.FixtureRequest) -> Points:
    return read_cloud(FOLDER / request.param, ReadOptions(intrinsics=CAMERA))


def test_the_network_sees_the_closed_door(cloud: Points) -> None:
    predictor = Predictor.load()
    assert predictor(cloud).label == "closed"
    assert predictor(cloud.reshape(-1, 3)).label in ("closed", "abstained")


def test_prepared_points_are_those_that_were_evaluated(cloud: Points) -> None:
    predictor = Predictor.load("ogurob-pointnet2")
    assert isinstance(predictor, NetworkPredictor)
    points = predictor.prepare(cloud).points
    prediction = predictor(cloud)
    outputs = predictor.backend(points[None])
    assert prediction.num_points == len(points)
    assert prediction.probabilities["closed"] == pytest.approx(float(outputs.probabilities[0, 0]), abs=1e-5)


@pytest.mark.parametrize("name", list_rules())
def test_no_rule_sees_an_open_door(name: str, cloud: Points) -> None:
    assert RulePredictor.from_name(name)(cloud).label in ("closed", "abstained")


def test_a_rule_may_keep_outliers(cloud: Points) -> None:
    kept = RulePredictor(create_rule("plane_state"), remove_outliers=False)(cloud)
    assert kept.num_points > RulePredictor.from_name("plane_state")(cloud).num_points


def test_too_many_outliers_are_refused(cloud: Points) -> None:
    lifted = cloud.copy()
    rng = np.random.default_rng(0)
    lost = rng.random(cloud.shape[:2]) < 0.3
    lifted[lost] *= rng.uniform(0.2, 3, (lost.sum(), 1)).astype(np.float32)
    for predictor in (Predictor.load(), RulePredictor.from_name("plane_state")):
        abstention = predictor(lifted).abstention
        assert abstention is not None
        assert abstention.code == "outliers"
        assert 0.1 < float(abstention.values["share"]) < 0.4
    assert Gate(max_outlier_share=0.5)(cloud, outlier_share=0.4) is None
