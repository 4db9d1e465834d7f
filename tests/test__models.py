# SPDX-License-Identifier: Apache-2.0
"""Names stay inside their folder, and numbers of settings are finite and possible."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from doorstate._models import Name
from doorstate.clouds.augmentation import Augmentation
from doorstate.clouds.preparation import CloudSpec
from doorstate.dataset.description import DatasetDescription
from doorstate.errors import CameraError, ConfigError
from doorstate.evaluation.results import ComparisonConfig
from doorstate.io.camera import Intrinsics
from doorstate.networks.card import WeightsCard
from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.presets import PRESETS
from doorstate.simulation.settings import SimulationSettings, settings_for
from doorstate.training.experiment import Experiment, load_experiment
from doorstate.training.recipes import Recipe

_NAME = TypeAdapter(Name)


@pytest.mark.parametrize(
    "name", ["../../X", "a/b", "..", ".", "", ".hidden", "a\\b", "a\nb", "a\0b", " a", "a" * 101]
)
def test_names_of_other_folders_are_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(ValidationError):
        _NAME.validate_python(name)
    for values in ({"name": name}, {"networks": [name]}, {"rules": [name]}):
        with pytest.raises(ConfigError):
            load_experiment(None, {"name": "a", "dataset": "data"} | values)
        with pytest.raises(ValidationError):
            ComparisonConfig.model_validate(_COMPARISON | values)


@pytest.mark.parametrize(
    "name", ["paper", "transfer: all on xtion", "kapı 1", "a.b", "as-trained-1024", "e" * 100]
)
def test_ordinary_names_are_taken(name: str) -> None:
    assert _NAME.validate_python(name) == name


_COMPARISON: dict[str, Any] = {
    "name": "a",
    "dataset": "data",
    "protocol": "paper",
    "networks": ["pointnet"],
    "folds": 1,
    "num_points": 128,
    "seed": 0,
}
_DESCRIPTION: dict[str, Any] = {
    "kind": "imported",
    "source": "a",
    "num_points": 256,
    "samples": 3,
    "doorstate_version": "0",
}
_INF, _NAN = float("inf"), float("nan")


@pytest.mark.parametrize(
    ("kind", "good", "bad"),
    [
        (
            Experiment,
            {"name": "a", "dataset": "data"},
            {"num_points": 10**18, "seed": -1, "folds": 10**9, "name": "../X"},
        ),
        (
            Recipe,
            {"name": "a"},
            {
                "epochs": 10**12,
                "learning_rate": _INF,
                "min_learning_rate": _NAN,
                "batch_size": 10**9,
                "clouds_per_epoch": 10**12,
                "weight_decay": _INF,
                "adam_eps": 0.0,
                "momentum": 1.5,
                "step_factor": -1.0,
                "step_epochs": 0,
                "step_iterations": 0,
                "gradient_clip": _NAN,
                "batchnorm_eps": -1.0,
                "batchnorm_momentum": (2.0, 0.1),
                "part_points": 10**18,
                "loss_weights": {"angle": _INF},
                "coarse_to_fine": [{"share": 0.5, "points": 10**18}],
                "augmentation": {"scale": (0.0, _INF)},
            },
        ),
        (Augmentation, {}, {"scale": (2.0, 1.0), "shift": _INF, "jitter": _NAN, "tilt_deg": 1e300}),
        (CloudSpec, {}, {"num_points": 10**18, "max_depth_m": _NAN}),
        (DatasetDescription, _DESCRIPTION, {"num_points": 10**18, "samples": -1, "max_depth_m": -_INF}),
        (
            WeightsCard,
            {"network": "pointnet", "num_points": 256},
            {
                "num_points": 0,
                "default_points": 10**18,
                "temperature": 1e-300,
                "network": "../X",
                "scale_m": _NAN,
            },
        ),
        (SimulationSettings, {"preset": PRESETS["varied"], "seed": 0}, {"seed": -1, "poses": 10**12}),
        (
            DepthCamera,
            {},
            {"width": 10**9, "height": 0, "hfov_deg": 180.0, "max_depth_m": _INF, "cx_px": _NAN},
        ),
    ],
)
def test_impossible_numbers_are_refused(kind: Any, good: dict[str, Any], bad: dict[str, Any]) -> None:
    kind.model_validate(good)
    for field, value in bad.items():
        with pytest.raises(ValidationError) as refused:
            kind.model_validate(good | {field: value})
        assert refused.value.errors()[0]["loc"][0] == field


def test_images_of_a_billion_pixels_are_refused() -> None:
    for size in ((10**9, 10**9), (8192, 8192), (10**5000, 1)):
        with pytest.raises(ValidationError):
            DepthCamera(width=size[0], height=size[1])
        with pytest.raises(CameraError):
            Intrinsics(*size, 500.0, 500.0, 1.0, 1.0)


def test_impossible_extents_of_a_simulation_are_named() -> None:
    for poses, seed in ((10**12, 0), (0, 0), (3, -1)):
        with pytest.raises(ConfigError):
            settings_for("varied", seed, scenes=poses)
