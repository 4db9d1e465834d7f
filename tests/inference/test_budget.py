# SPDX-License-Identifier: Apache-2.0
"""A time budget takes the most points that are fast enough."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from doorstate.errors import ConfigError
from doorstate.inference.budget import wall_and_floor
from doorstate.inference.gate import Gate
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.networks import create_network
from doorstate.networks.card import WeightsCard
from doorstate.networks.weights import save_weights


def clock_of(milliseconds: list[float]) -> Callable[[], float]:
    """Return a clock on which the n-th call of a predictor takes the n-th time."""
    stamps = iter([stamp for duration in milliseconds for stamp in (0.0, duration / 1000)])
    return lambda: next(stamps)


@pytest.mark.parametrize(
    ("budget_ms", "points"), [(100.0, 1024), (33.0, 1024), (29.9, 512), (20.0, 512), (19.0, 256), (0.1, 256)]
)
def test_a_budget_takes_the_most_points_within_it(tmp_path: Path, budget_ms: float, points: int) -> None:
    path = tmp_path / "mine.safetensors"
    save_weights(path, create_network("pointnet"), WeightsCard(network="pointnet", num_points=1024))
    # The first of six calls warms up; the median of the others counts.
    with_512, with_1024 = [500.0, 9.0, 20.0, 20.0, 20.0, 90.0], [500.0, 30.0, 30.0, 30.0, 7.0, 90.0]
    predictor = NetworkPredictor.from_weights(path, budget_ms=budget_ms, clock=clock_of(with_512 + with_1024))
    assert predictor.num_points == points


def test_a_budget_takes_no_more_points_than_trained_with(tmp_path: Path) -> None:
    path = tmp_path / "mine.safetensors"
    save_weights(path, create_network("pointnet"), WeightsCard(network="pointnet", num_points=200))
    assert NetworkPredictor.from_weights(path, budget_ms=1.0).num_points == 200


def test_the_scene_of_the_measurement_passes_the_gate() -> None:
    scene = wall_and_floor()
    assert scene.shape == (480, 640, 3)
    assert Gate()(scene) is None


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"budget_ms": 0.0}, "budget_ms"),
        ({"budget_ms": float("nan")}, "budget_ms"),
        ({"budget_ms": 33.0, "num_points": 512}, "budget_ms"),
        ({"threads": 0}, "threads"),
    ],
)
def test_impossible_budgets_and_threads_are_refused(options: dict[str, Any], field: str) -> None:
    with pytest.raises(ConfigError) as caught:
        NetworkPredictor.from_weights(**options)
    assert caught.value.field == field
