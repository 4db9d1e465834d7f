# SPDX-License-Identifier: Apache-2.0
"""One way to load every network and rule, with options that exclude each other."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from doorstate.errors import ConfigError, WeightsError
from doorstate.inference.gate import DEFAULT_GATE
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.predictor import DEFAULT_NETWORK, Predictor
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.networks import create_network
from doorstate.networks.card import WeightsCard
from doorstate.networks.weights import save_weights


def num_points_of(path: Path, **options: Any) -> int:
    predictor = Predictor.load(path, **options)
    assert isinstance(predictor, NetworkPredictor)
    return predictor.num_points


def test_a_name_a_file_or_a_rule_loads_its_predictor(weights: Path) -> None:
    network, file, rule = Predictor.load(), Predictor.load(weights), Predictor.load(rule="plane_state")
    assert isinstance(network, NetworkPredictor)
    assert isinstance(rule, RulePredictor)
    assert (network.name, file.name, rule.name) == (DEFAULT_NETWORK, "pointnet", "plane_state")
    assert (network.gate, rule.gate) == (DEFAULT_GATE, DEFAULT_GATE)
    assert Predictor.load(rule="plane_state", gate=None).gate is None


@pytest.mark.parametrize(
    "options",
    [
        {"name_or_path": "pointnet2", "rule": "plane_state"},
        {"rule": "plane_state", "num_points": 512},
        {"rule": "plane_state", "budget_ms": 33.0},
        {"num_points": 512, "budget_ms": 33.0},
        {"budget_ms": 0.0},
        {"rule": "plain_state"},
    ],
)
def test_options_that_exclude_each_other_are_errors(options: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        Predictor.load(**options)


def test_weights_load_by_path_and_by_name(tmp_path: Path) -> None:
    path = tmp_path / "mine.safetensors"
    save_weights(path, create_network("pointcnn"), WeightsCard(network="pointcnn", num_points=256))
    assert num_points_of(path) == 256
    assert num_points_of(path, num_points=512) == 512
    fewer = WeightsCard(network="pointcnn", num_points=256, default_points=192)
    save_weights(path, create_network("pointcnn"), fewer)
    assert num_points_of(path) == 192
    with pytest.raises(WeightsError, match="nonet"):
        Predictor.load("nonet")


@pytest.mark.parametrize("points", [0, -5, 127])
def test_fewer_points_than_a_network_needs_are_an_error(points: int) -> None:
    with pytest.raises(ConfigError):
        Predictor.load(num_points=points)
