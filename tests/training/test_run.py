# SPDX-License-Identifier: Apache-2.0
"""Runs: files, predictions, start weights, recipes, heads, refused folders."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from sklearn.metrics import f1_score

from doorstate._files import read_csv
from doorstate.dataset.roles import Role
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import ConfigError, RunError, WeightsError
from doorstate.networks.weights import load_weights
from doorstate.training.recipes import AUTHORS, CoarseStage
from doorstate.training.run import train_run
from tests.training.runs import RECIPE, run_config


def test_files_of_a_finished_run(finished_run: Path, fold_roles: dict[str, Role]) -> None:
    assert sorted(path.name for path in finished_run.iterdir()) == [
        "config.json",
        "digests.json",
        "environment.json",
        "log.csv",
        "metrics.json",
        "predictions.csv",
        "validation.csv",
        "weights.safetensors",
    ]
    predictions = read_csv(finished_run / "predictions.csv")
    assert {row["sample_id"] for row in predictions} == {
        name for name, role in fold_roles.items() if role == "test"
    }
    metrics = json.loads((finished_run / "metrics.json").read_text())
    oracle = f1_score(
        [row["state"] for row in predictions],
        [row["predicted"] for row in predictions],
        average="macro",
        zero_division=0,
    )
    assert metrics["test_macro_f1"] == pytest.approx(oracle)
    log = read_csv(finished_run / "log.csv")
    assert [line["epoch"] for line in log] == ["0", "1", "2"]
    best = max(float(line["val_macro_f1"]) for line in log)
    assert metrics["val_macro_f1"] == pytest.approx(best, abs=1e-5)


def test_saved_weights_give_the_saved_predictions(finished_run: Path, small_dataset: PreparedDataset) -> None:
    from doorstate.clouds.normalization import normalize

    network, card = load_weights(finished_run / "weights.safetensors")
    assert card.num_points == 128
    for row in read_csv(finished_run / "predictions.csv")[:3]:
        cloud = small_dataset.cloud(small_dataset.index_of(row["sample_id"]))[:128]
        with torch.no_grad():
            probabilities = network(torch.from_numpy(normalize(cloud))[None]).softmax(1)[0].numpy()
        saved = [float(row[f"p_{state}"]) for state in ("closed", "semi_open", "open")]
        np.testing.assert_allclose(saved, probabilities, atol=2e-5)


def test_finished_run_is_not_trained_again(
    finished_run: Path, small_dataset: PreparedDataset, fold_roles: dict[str, Role]
) -> None:
    before = {path.name: path.stat().st_mtime_ns for path in finished_run.iterdir()}
    train_run(run_config(), small_dataset, fold_roles, finished_run)
    assert {path.name: path.stat().st_mtime_ns for path in finished_run.iterdir()} == before


def test_training_does_not_change_the_global_generator(
    small_dataset: PreparedDataset, fold_roles: dict[str, Role], tmp_path: Path
) -> None:
    torch.manual_seed(5)
    expected = torch.rand(1)
    torch.manual_seed(5)
    train_run(
        run_config(recipe=RECIPE.model_copy(update={"epochs": 1})),
        small_dataset,
        fold_roles,
        tmp_path / "run",
    )
    assert torch.equal(torch.rand(1), expected)


def test_start_weights_must_fit(
    finished_run: Path, small_dataset: PreparedDataset, fold_roles: dict[str, Role], tmp_path: Path
) -> None:
    weights = str(finished_run / "weights.safetensors")
    with pytest.raises(WeightsError) as caught:
        train_run(
            run_config(network="pointnet", start_from=weights), small_dataset, fold_roles, tmp_path / "a"
        )
    assert (str(caught.value.path), caught.value.expected) == (weights, "pointnet")
    with pytest.raises(WeightsError) as caught:
        train_run(
            run_config(heads=("door",), start_from=weights), small_dataset, fold_roles, tmp_path / "heads"
        )
    assert (str(caught.value.path), caught.value.expected) == (weights, "door")
    with pytest.raises(WeightsError, match="missing"):
        train_run(run_config(start_from="missing"), small_dataset, fold_roles, tmp_path / "b")
    with pytest.raises(ConfigError) as no_epochs:
        train_run(
            run_config(recipe=RECIPE.model_copy(update={"epochs": 0})),
            small_dataset,
            fold_roles,
            tmp_path / "c",
        )
    assert no_epochs.value.field == "epochs"


def test_validation_predictions_are_kept_for_calibration(
    finished_run: Path, fold_roles: dict[str, Role]
) -> None:
    rows = read_csv(finished_run / "validation.csv")
    assert {row["sample_id"] for row in rows} == {name for name, role in fold_roles.items() if role == "val"}
    metrics = json.loads((finished_run / "metrics.json").read_text())
    correct = [row["state"] == row["predicted"] for row in rows]
    assert metrics["val_accuracy"] == pytest.approx(sum(correct) / len(correct))


def test_folder_of_another_run_is_refused(
    finished_run: Path, small_dataset: PreparedDataset, fold_roles: dict[str, Role]
) -> None:
    with pytest.raises(RunError, match="fold, seed") as caught:
        train_run(run_config(seed=2, fold=1), small_dataset, fold_roles, finished_run)
    assert (caught.value.path, caught.value.field) == (finished_run, "fold")


@pytest.mark.parametrize("name", ["pointnet", "dgcnn", "pointcnn", "point2sequence"])
def test_every_network_trains_with_the_recipe_of_its_authors(
    name: str, small_dataset: PreparedDataset, fold_roles: dict[str, Role], tmp_path: Path
) -> None:
    recipe = AUTHORS[name].model_copy(update={"epochs": 1, "batch_size": 8})
    metrics = train_run(run_config(network=name, recipe=recipe), small_dataset, fold_roles, tmp_path / "run")
    assert 0 <= metrics["test_macro_f1"] <= 1


@pytest.mark.parametrize("network", ["pointnet2", "pointcnn"])
def test_heads_are_trained_jointly_and_written_in_metres(
    network: str, scene_dataset: PreparedDataset, scene_roles: dict[str, Role], tmp_path: Path
) -> None:
    heads = ("door", "angle", "hinge", "frame", "widths", *(("parts",) if network == "pointnet2" else ()))
    recipe = RECIPE.model_copy(update={"epochs": 2, "coarse_to_fine": (CoarseStage(share=0.5, points=128),)})
    run = run_config(network=network, heads=heads, recipe=recipe, protocol="by-scene", num_points=160)
    metrics = train_run(run, scene_dataset, scene_roles, tmp_path)
    tested = [sample for sample, role in scene_roles.items() if role == "test"]
    rows = read_csv(tmp_path / "head_outputs.csv")
    assert [row["sample_id"] for row in rows] == tested
    validated = [sample for sample, role in scene_roles.items() if role == "val"]
    assert [row["sample_id"] for row in read_csv(tmp_path / "validation_heads.csv")] == validated
    assert set(rows[0]) == {
        "sample_id",
        "p_door",
        "opening_angle_deg",
        "p_hinge_left",
        "door_x_m",
        "door_y_m",
        "door_yaw_deg",
        "opening_width_m",
        "passable_width_m",
    }
    doors = [row["sample_id"] for row in read_csv(tmp_path / "predictions.csv")]
    assert doors == [s for s in tested if not s.endswith("no_door")]
    assert 0 < len(doors) < len(tested)
    assert 0 <= metrics["test_macro_f1"] <= 1
    if network == "pointnet2":
        labelled = sum(int((scene_dataset.parts(scene_dataset.index_of(s)) != 255).sum()) for s in tested)  # type: ignore[union-attr]
        assert np.sum(metrics["test_part_counts"]) == labelled
    loaded, card = load_weights(tmp_path / "weights.safetensors")
    assert card.heads == heads
    assert list(loaded.heads) == list(heads)


def test_run_with_other_heads_is_refused(
    scene_dataset: PreparedDataset, scene_roles: dict[str, Role], tmp_path: Path
) -> None:
    run = run_config(heads=("door", "frame"), recipe=RECIPE.model_copy(update={"epochs": 1}))
    train_run(run, scene_dataset, scene_roles, tmp_path)
    with pytest.raises(RunError) as caught:
        train_run(
            run_config(recipe=RECIPE.model_copy(update={"epochs": 1})), scene_dataset, scene_roles, tmp_path
        )
    assert caught.value.field == "heads"
