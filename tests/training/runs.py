# SPDX-License-Identifier: Apache-2.0
"""Configuration and results of short runs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from doorstate.clouds.augmentation import Augmentation
from doorstate.dataset.store import PreparedDataset
from doorstate.training.config import RunConfig
from doorstate.training.experiment import Experiment
from doorstate.training.recipes import Recipe

RECIPE = Recipe(
    name="test",
    epochs=3,
    batch_size=8,
    augmentation=Augmentation(yaw_deg=10, mirror=0.5, jitter=0.002),
    precision="fp32",
)


def run_config(**changes: Any) -> RunConfig:
    """Return the configuration of a short run."""
    values: dict[str, Any] = {
        "network": "pointnet2",
        "dataset": "small",
        "protocol": "paper",
        "fold": 0,
        "num_points": 128,
        "seed": 1,
        "recipe": RECIPE,
    }
    return RunConfig.model_validate(values | changes)


def read_results(folder: Path) -> tuple[str, dict[str, Any], bytes]:
    """Return predictions, metrics without the duration, and weights of a finished run."""
    metrics = json.loads((folder / "metrics.json").read_text())
    metrics.pop("seconds")
    return (folder / "predictions.csv").read_text(), metrics, (folder / "weights.safetensors").read_bytes()


CHANGES = {"epochs": 4, "batch_size": 8, "precision": "fp32"}


def small_experiment(dataset: PreparedDataset, **changes: Any) -> Experiment:
    """Return an experiment of one network and two folds."""
    values = {
        "name": "test",
        "dataset": str(dataset.folder),
        "networks": ("pointnet2",),
        "folds": 2,
        "num_points": 128,
        "recipe_changes": CHANGES,
    }
    return Experiment.model_validate(values | changes)
