# SPDX-License-Identifier: Apache-2.0
"""Weights in the package: small enough together, and made with their cards by one command."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from doorstate.dataset.splits import draw_splits, write_splits
from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.results import load_results
from doorstate.inference.predictor import Predictor
from doorstate.networks.weights import read_card
from doorstate.training.calibration import at_temperature
from doorstate.training.comparison import compare, prepare_comparison
from doorstate.training.experiment import Experiment
from doorstate.types import NO_DOOR

RECIPE = {"epochs": 1, "batch_size": 8, "precision": "fp32", "coarse_to_fine": []}


@pytest.fixture
def tool(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    from paper import weights

    return weights


def publish(source: Path, target: Path) -> None:
    from paper import publish as module

    module.publish(source, target)


@pytest.fixture
def package(tool: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty one, beside empty results and experiments."""
    for name, folder in (("RESULTS", "results"), ("EXPERIMENTS", "experiments"), ("WEIGHTS", "package")):
        (tmp_path / folder).mkdir()
        monkeypatch.setattr(tool, name, tmp_path / folder)
    monkeypatch.setattr(tool, "PAGE", tmp_path / "zoo.md")
    return tmp_path / "package"


def test_weights_are_packaged_with_a_temperature_and_a_card(
    tool: ModuleType, package: Path, small_dataset: PreparedDataset, tmp_path: Path
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
    prepare_comparison(everything.model_copy(update={"networks": ("pointnet", "dgcnn")}), tmp_path / "half")
    tool.main(str(tmp_path / "half"))
    assert list(package.iterdir()) == [], "nothing is trained there yet"
    tool.main(str(tmp_path / "weights"))

    card = read_card(package / "pointnet.safetensors")
    assert card.temperature != 1
    assert card.max_depth_m == 5
    assert card.points == card.num_points == 128, "no study says that fewer do"
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


def test_weights_that_were_tested_say_how_well_and_when_they_are_unsure(
    tool: ModuleType, package: Path, scene_dataset: PreparedDataset, tmp_path: Path
) -> None:
    doors = {row["sample_id"] for row in scene_dataset.rows if row["state"] != NO_DOOR}
    fold = next(
        roles
        for roles in draw_splits(scene_dataset.rows, "by-scene", 0)
        if {"val", "test"} <= {roles[door] for door in doors}
    )
    common = {
        "dataset": str(scene_dataset.folder),
        "protocol": "by-scene",
        "networks": ("pointnet",),
        "folds": 1,
        "num_points": 128,
        "heads": ("door", "angle"),
    }
    runs, results = tmp_path / "runs", tmp_path / "results"
    for folder in (runs / "mixture", runs / "longer", runs / "points" / "as-trained-128"):
        write_splits(folder / "splits.csv", [fold])
    experiment = Experiment.model_validate(common | {"name": "mixture", "recipe_changes": RECIPE})
    compare(experiment, runs / "mixture")
    fewer = {"name": "fewer", "start_from": str(runs / "mixture"), "recipe_changes": {"epochs": 0}}
    compare(Experiment.model_validate(common | fewer), runs / "points" / "as-trained-128")
    (tmp_path / "experiments" / "points.toml").write_text(
        f'dataset = "{scene_dataset.folder}"\nstart_from = "runs/mixture"\npoints = [128]\n'
    )
    for name in ("mixture", "points"):
        publish(runs / name, results / name)
    tool.main(str(runs / "mixture"), "some-")

    card = read_card(package / "some-pointnet.safetensors")
    assert card.default_points == 128, "the study knows no other"
    (validation,) = load_results(runs / "mixture").runs_of("pointnet")
    assert validation.validation is not None
    scaled = at_temperature(validation.validation.probabilities, card.temperature)
    wrong = scaled.argmax(axis=1) != validation.validation.true
    answered = scaled.max(axis=1) >= card.abstain_below
    assert wrong[answered].sum() <= tool._WRONG_SHARE * answered.sum()
    assert not wrong.any() or card.abstain_below > 0
    text = (package / "some-pointnet.md").read_text(encoding="utf-8")
    assert "--network some-pointnet" in text
    assert "further heads: door, angle" in text
    assert f"Below a probability of {card.abstain_below:.3f} a predictor gives no state" in text
    for title in (
        "Answers of further heads",
        "Accuracy by kind of sample",
        "Accuracy and time by number of points",
    ):
        assert f"**{title}**" in text
    assert "| pointnet |" not in text, "whose card it is need not be said in every line"
    assert "goes on from" not in text
    told = Predictor.load(package / "some-pointnet.safetensors", gate=None)(scene_dataset.raw_cloud(0))
    assert told.opening_angle_deg is not None

    weighed = RECIPE | {"loss_weights": {"state": 2.0}}
    longer = {"name": "longer", "start_from": str(runs / "mixture"), "recipe_changes": weighed}
    compare(Experiment.model_validate(common | longer), runs / "longer")
    publish(runs / "longer", results / "longer")
    tool.main(str(runs / "longer"), "longer-")
    text = (package / "longer-pointnet.md").read_text(encoding="utf-8")
    assert "goes on from the weights of paper/experiments/mixture.toml" in text
    assert "the loss of the state counted 2 times" in text
