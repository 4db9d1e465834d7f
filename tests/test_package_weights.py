# SPDX-License-Identifier: Apache-2.0
"""Weights in the package: small enough together, and made with their cards by one command."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from doorstate.dataset.store import PreparedDataset
from doorstate.deployment.predictor import Predictor, packaged_networks, packaged_weights
from doorstate.training.comparison import Experiment, compare
from doorstate.training.weights import read_card

TOOLS = Path(__file__).parents[1] / "tools"
RECIPE = {"epochs": 1, "batch_size": 8, "precision": "fp32", "coarse_to_fine": []}


@pytest.fixture
def tool(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(TOOLS))
    import package_weights

    return package_weights


def test_the_package_stays_small() -> None:
    paths = [packaged_weights(name) for name in packaged_networks()]
    assert paths
    assert sum(path.stat().st_size for path in paths) <= 25e6


def test_weights_are_packaged_with_a_temperature_and_a_card(
    tool: ModuleType, small_dataset: PreparedDataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    common = {
        "dataset": str(small_dataset.folder),
        "networks": ("pointnet",),
        "num_points": 128,
        "recipe_changes": RECIPE,
    }
    for name, protocol in (("paper", "paper"), ("by-pose", "paper")):
        experiment = Experiment.model_validate(common | {"name": name, "protocol": protocol})
        compare(experiment, tmp_path / "results" / name)
    everything = Experiment.model_validate(common | {"name": "weights", "protocol": "all", "folds": 1})
    compare(everything, tmp_path / "weights")
    (tmp_path / "results" / "ogurob-4096").symlink_to(small_dataset.folder)
    package = tmp_path / "package"
    package.mkdir()
    monkeypatch.setattr(tool, "RESULTS", tmp_path / "results")
    monkeypatch.setattr(tool, "WEIGHTS", package)
    monkeypatch.setattr(tool, "PAGE", tmp_path / "zoo.md")
    tool.main(str(tmp_path / "weights"))

    card = read_card(package / "pointnet.safetensors")
    assert card.temperature != 1
    assert card.max_depth_m == 5
    text = (package / "pointnet.md").read_text(encoding="utf-8")
    assert "all 36 simulated clouds" in text
    assert "| augmentation | yaw deg 15.0 |" in text
    assert f"| {card.temperature}: median" in text
    assert text.count("| paper | 36 |") == 2
    assert "# " in (tmp_path / "zoo.md").read_text(encoding="utf-8")
    cloud = small_dataset.raw_cloud(0)
    halved = Predictor.load(package / "pointnet.safetensors", gate=None)(cloud)
    full = Predictor.load(
        tmp_path / "weights" / "runs" / "pointnet" / "fold0" / "weights.safetensors", gate=None
    )(cloud)
    assert np.argmax(list(halved.probabilities.values())) == np.argmax(list(full.probabilities.values()))
