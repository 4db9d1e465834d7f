# SPDX-License-Identifier: Apache-2.0
"""Weights are stored with calibration, default points and model cards."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pandas as pd
import pytest
from paper.publish import publish
from paper.weights import GUARANTEED_SHARE, WRONG_SHARE, choose_threshold, package_weights

from doorstate.dataset.splits import draw_splits, write_splits
from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.calibration import labels_and_probabilities
from doorstate.evaluation.predictions import load_results
from doorstate.evaluation.results import Results
from doorstate.inference.predictor import Predictor
from doorstate.networks.card import Guarantee, WeightsCard
from doorstate.networks.card_file import read_card
from doorstate.training.calibration import at_temperature
from doorstate.training.comparison import compare, prepare_comparison
from doorstate.training.experiment import Experiment
from doorstate.types import NO_DOOR
from paper import published

RECIPE = {"epochs": 1, "batch_size": 8, "precision": "fp32", "coarse_to_fine": []}


@pytest.fixture(autouse=True)
def _nothing_cached() -> Iterator[None]:
    for function in (published.comparison, published.study):
        function.cache_clear()
    yield
    for function in (published.comparison, published.study):
        function.cache_clear()


def test_weights_trained_on_everything(folders: Path, small_dataset: PreparedDataset) -> None:
    common = {
        "dataset": str(small_dataset.folder),
        "networks": ("pointnet",),
        "num_points": 128,
        "recipe_changes": RECIPE,
    }
    for name in ("paper", "by-pose"):
        (folders / "experiments" / f"{name}.toml").write_text(f'dataset = "{small_dataset.folder}"\n')
        experiment = Experiment.model_validate(common | {"name": name, "protocol": "paper"})
        compare(experiment, folders / "runs" / name)
        publish(name)
    everything = Experiment.model_validate(common | {"name": "weights", "protocol": "all", "folds": 1})
    compare(everything, folders / "runs" / "weights")
    half = everything.model_copy(update={"networks": ("pointnet", "dgcnn")})
    prepare_comparison(half, folders / "runs" / "half")
    out = folders / "package"
    assert package_weights("half", out=out) == [], "nothing is trained there yet"
    (path,) = package_weights("weights", "ogurob-", out=out)

    card = read_card(path)
    assert path.name == "ogurob-pointnet.safetensors"
    assert card.temperature != 1
    assert card.max_depth_m == 5
    assert card.points_in_use == card.num_points == 128, "no study tells that fewer are enough"
    text = path.with_suffix(".md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 60
    assert text.count("| paper | 36 |") == 2
    cloud = small_dataset.raw_cloud(0)
    trained = folders / "runs" / "weights" / "runs" / "pointnet" / "fold0" / "weights.safetensors"
    halved, full = (Predictor.load(file, gate=None)(cloud).probabilities for file in (path, trained))
    assert np.argmax(list(halved.values())) == np.argmax(list(full.values()))


def test_weights_with_a_test_of_their_own(folders: Path, scene_dataset: PreparedDataset) -> None:
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
        "heads": ("door", "angle", "hinge", "frame", "widths"),
    }
    runs = folders / "runs"
    for folder in (runs / "mixture", runs / "points" / "as-trained-128"):
        write_splits(folder / "splits.csv", [fold])
    compare(
        Experiment.model_validate(common | {"name": "mixture", "recipe_changes": RECIPE}), runs / "mixture"
    )
    fewer = {"name": "fewer", "start_from": str(runs / "mixture"), "recipe_changes": {"epochs": 0}}
    compare(Experiment.model_validate(common | fewer), runs / "points" / "as-trained-128")
    dataset = f'dataset = "{scene_dataset.folder}"\n'
    (folders / "experiments" / "mixture.toml").write_text(dataset)
    (folders / "experiments" / "points.toml").write_text(
        f'{dataset}start_from = "runs/mixture"\npoints = [128]\n'
    )
    for name in ("mixture", "points"):
        publish(name)
    (path,) = package_weights("mixture", networks=["pointnet"], out=folders / "package")

    card = read_card(path)
    assert card.default_points == 128
    rows = load_results(runs / "mixture").predictions
    labels, probabilities = labels_and_probabilities(
        rows[(rows["role"] == "val") & (rows["state"] != NO_DOOR)]
    )
    scaled = at_temperature(probabilities, card.temperature)
    wrong = scaled.argmax(axis=1) != labels
    named = scaled.max(axis=1) >= card.abstain_below
    assert wrong[named].sum() <= WRONG_SHARE * named.sum()
    assert not wrong.any() or card.abstain_below > 0
    assert card.guarantee is None, "a few scenes guarantee nothing"
    text = path.with_suffix(".md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 90
    tested = load_results(runs / "mixture").tested
    assert f"| all |  | {len(tested)} |" in text
    prediction = Predictor.load(path, gate=None)(scene_dataset.raw_cloud(0))
    assert prediction.opening_angle_deg is not None


@pytest.mark.parametrize(("scenes", "guaranteed"), [(400, True), (100, False)])
def test_enough_scenes_guarantee_the_threshold(scenes: int, guaranteed: bool) -> None:
    """Two samples a scene, all right: they count once."""
    rows = pd.DataFrame(
        {
            "method": "pointnet",
            "role": "val",
            "state": "open",
            "scene_id": [f"s{index // 2}" for index in range(2 * scenes)],
            "p_closed": 0.0,
            "p_semi_open": 0.05,
            "p_open": 0.95,
        }
    )
    threshold, guarantee = choose_threshold(
        cast(Results, SimpleNamespace(joined=rows)), "pointnet", 1.0, None
    )
    assert (guarantee is not None) == guaranteed
    if guarantee is not None:
        assert (guarantee.scenes, guarantee.answered, guarantee.wrong) == (scenes, scenes, 0)
        assert guarantee.wrong_share == GUARANTEED_SHARE
        assert 0 < threshold < 0.95
    else:
        assert threshold == 0, "chosen by counting: nothing is wrong"


def test_cards_without_a_guarantee_still_load() -> None:
    card = WeightsCard(network="pointnet", num_points=128)
    stored = json.loads(card.model_dump_json())
    del stored["guarantee"]
    assert WeightsCard.parse(json.dumps(stored)) == card
    promised = card.model_copy(
        update={"guarantee": Guarantee(wrong_share=0.02, confidence=0.9, scenes=400, answered=300, wrong=1)}
    )
    assert WeightsCard.parse(promised.model_dump_json()) == promised
