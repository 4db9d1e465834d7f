# SPDX-License-Identifier: Apache-2.0
"""Weights that are moved back until nothing is forgotten, and their calibration."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from doorstate.errors import RunError
from doorstate.networks import create_network
from doorstate.networks.card import WeightsCard
from doorstate.networks.weights import load_weights, save_weights
from doorstate.training.adaptation import weights as adapted_weights
from doorstate.training.adaptation.weights import StateProbabilities, calibrate, keep_knowledge, states_of
from doorstate.training.calibration import at_temperature
from doorstate.training.recipes import Recipe
from doorstate.training.run import create_fabric

FABRIC = create_fabric(Recipe(name="test", precision="fp32"), torch.device("cpu"))


def states(share_right: float, count: int = 100) -> StateProbabilities:
    """Return confident answers of which a share is right."""
    labels = np.arange(count) % 3
    predicted = np.where(np.arange(count) < share_right * count, labels, (labels + 1) % 3)
    return StateProbabilities(labels, np.where(np.eye(3, dtype=bool)[predicted], 0.9, 0.05))


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """Two weights files of one network."""
    torch.manual_seed(0)
    paths = tmp_path / "start.safetensors", tmp_path / "trained.safetensors"
    for path in paths:
        save_weights(path, create_network("pointnet2"), WeightsCard(network="pointnet2", num_points=128))
    return paths


@pytest.mark.parametrize(
    ("after", "expected"), [([0.9], 1.0), ([0.8, 0.885], 0.75), ([0.5, 0.7, 0.8, 0.9], 0.25)]
)
def test_weights_go_back_until_simulated_doors_are_known(
    files: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, after: list[float], expected: float
) -> None:
    script = iter([states(0.89), *map(states, after)])
    monkeypatch.setattr(adapted_weights, "states_of", lambda *_: next(script))
    adapted = keep_knowledge(*files, FABRIC, [])
    assert adapted.share == expected
    first, last = (load_weights(path)[0].state_dict() for path in files)
    for name, tensor in adapted.network.state_dict().items():
        if tensor.is_floating_point():
            torch.testing.assert_close(tensor, torch.lerp(first[name], last[name], expected))


def test_training_that_forgets_is_refused(files: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    script = iter([states(0.9), *map(states, [0.5] * 4)])
    monkeypatch.setattr(adapted_weights, "states_of", lambda *_: next(script))
    with pytest.raises(RunError) as refused:
        keep_knowledge(*files, FABRIC, [])
    assert refused.value.path == files[1]


def test_states_of_samples(files: tuple[Path, Path], small_dataset) -> None:
    network, card = load_weights(files[0])
    found = states_of(network, card, FABRIC, [small_dataset], small_dataset.sample_ids[:6])
    assert found.labels.tolist() == small_dataset.labels[:6].tolist()
    np.testing.assert_allclose(found.probabilities.sum(axis=1), 1, atol=1e-5)


def test_held_out_and_simulated_clouds_count_equally() -> None:
    simulated, sure = states(1.0, 300), states(1.0, 6)
    alone, least = calibrate(simulated, None)
    assert least == 0.0
    assert calibrate(simulated, sure) == (pytest.approx(alone, rel=0.2), 0.0)
    temperature, least = calibrate(simulated, states(0.0, 6))
    assert temperature > 2 * alone
    # Half of the answers are wrong and all are equally sure, so that none may be given.
    assert least > at_temperature(simulated.probabilities, temperature).max() - 1e-3
