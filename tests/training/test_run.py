# SPDX-License-Identifier: Apache-2.0
"""Runs: files, exact continuation after a stop, refused inputs, heads."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from sklearn.metrics import f1_score
from torch._dynamo.exc import TorchDynamoException

from doorstate._files import read_csv
from doorstate.clouds.augmentation import Augmentation
from doorstate.dataset.loader import Batch
from doorstate.dataset.splits import Role, draw_splits
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import ConfigError, DatasetError, RunError, WeightsError
from doorstate.networks.pointnet2 import PointNet2
from doorstate.networks.weights import load_weights
from doorstate.training import trainer as trainer_module
from doorstate.training.config import RunConfig
from doorstate.training.recipes import AUTHORS, CoarseStage, Recipe
from doorstate.training.run import train_run
from doorstate.training.trainer import Trainer
from tests.training.test_schedules import oracle_rate

RECIPE = Recipe(
    name="test",
    epochs=3,
    batch_size=8,
    augmentation=Augmentation(yaw_deg=10, mirror=0.5, jitter=0.002),
    precision="fp32",
)


def config(**changes: Any) -> RunConfig:
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


@pytest.fixture(scope="module")
def roles(small_dataset: PreparedDataset) -> dict[str, Role]:
    return draw_splits(small_dataset.rows, "paper", 0)[0]


@pytest.fixture(scope="module")
def finished(
    small_dataset: PreparedDataset, roles: dict[str, Role], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    folder = tmp_path_factory.mktemp("run") / "whole"
    train_run(config(), small_dataset, roles, folder)
    return folder


def results(folder: Path) -> tuple[str, dict[str, Any], bytes]:
    metrics = json.loads((folder / "metrics.json").read_text())
    metrics.pop("seconds")
    return (folder / "predictions.csv").read_text(), metrics, (folder / "weights.safetensors").read_bytes()


def train_until(
    epoch: int,
    dataset: PreparedDataset,
    roles: dict[str, Role],
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Stop a run before an epoch."""

    def train_epoch(self: Trainer, current: int) -> None:
        if current == epoch:
            raise KeyboardInterrupt
        original(self, current)

    original = Trainer.train_epoch
    with monkeypatch.context() as patch:
        patch.setattr(Trainer, "train_epoch", train_epoch)
        with pytest.raises(KeyboardInterrupt):
            train_run(config(), dataset, roles, folder)


def test_files_of_a_finished_run(finished: Path, roles: dict[str, Role]) -> None:
    assert sorted(path.name for path in finished.iterdir()) == [
        "config.json",
        "environment.json",
        "log.csv",
        "metrics.json",
        "predictions.csv",
        "validation.csv",
        "weights.safetensors",
    ]
    predictions = read_csv(finished / "predictions.csv")
    assert {row["sample_id"] for row in predictions} == {
        name for name, role in roles.items() if role == "test"
    }
    metrics = json.loads((finished / "metrics.json").read_text())
    oracle = f1_score(
        [row["state"] for row in predictions],
        [row["predicted"] for row in predictions],
        average="macro",
        zero_division=0,
    )
    assert metrics["test_macro_f1"] == pytest.approx(oracle)
    log = read_csv(finished / "log.csv")
    assert [line["epoch"] for line in log] == ["0", "1", "2"]
    best = max(float(line["val_macro_f1"]) for line in log)
    assert metrics["val_macro_f1"] == pytest.approx(best, abs=1e-5)


def test_saved_weights_give_the_saved_predictions(finished: Path, small_dataset: PreparedDataset) -> None:
    from doorstate.clouds.normalization import normalize

    network, card = load_weights(finished / "weights.safetensors")
    assert card.num_points == 128
    for row in read_csv(finished / "predictions.csv")[:3]:
        cloud = small_dataset.cloud(small_dataset.index_of(row["sample_id"]))[:128]
        with torch.no_grad():
            probabilities = network(torch.from_numpy(normalize(cloud))[None]).softmax(1)[0].numpy()
        saved = [float(row[f"p_{state}"]) for state in ("closed", "semi_open", "open")]
        np.testing.assert_allclose(saved, probabilities, atol=2e-5)


def test_finished_run_is_not_trained_again(
    finished: Path, small_dataset: PreparedDataset, roles: dict[str, Role]
) -> None:
    before = {path.name: path.stat().st_mtime_ns for path in finished.iterdir()}
    train_run(config(), small_dataset, roles, finished)
    assert {path.name: path.stat().st_mtime_ns for path in finished.iterdir()} == before


@pytest.mark.parametrize("stop_after", [1, 2])
def test_run_stopped_between_epochs_continues_exactly(
    stop_after: int,
    finished: Path,
    small_dataset: PreparedDataset,
    roles: dict[str, Role],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    train_until(stop_after, small_dataset, roles, tmp_path / "run", monkeypatch)
    assert (tmp_path / "run" / "checkpoint.pt").is_file()
    torch.manual_seed(99)  # the state of the global generator must not matter
    train_run(config(), small_dataset, roles, tmp_path / "run")
    assert results(tmp_path / "run") == results(finished)


def test_run_stopped_within_an_epoch_continues_exactly(
    finished: Path,
    small_dataset: PreparedDataset,
    roles: dict[str, Role],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    steps = 0

    def train_step(self: Trainer, batch: Batch) -> float:
        nonlocal steps
        steps += 1
        if steps == 6:  # the third of three in the second epoch
            raise KeyboardInterrupt
        return original(self, batch)

    original = Trainer.train_step
    with monkeypatch.context() as patch:
        patch.setattr(trainer_module, "_CHECKPOINT_INTERVAL_S", 0.0)
        patch.setattr(Trainer, "train_step", train_step)
        with pytest.raises(KeyboardInterrupt):
            train_run(config(), small_dataset, roles, tmp_path / "run")
    steps = -100
    with monkeypatch.context() as patch:
        patch.setattr(Trainer, "train_step", train_step)
        train_run(config(), small_dataset, roles, tmp_path / "run")
    assert steps == -100 + 9 - 5, "only the remaining steps"
    assert results(tmp_path / "run") == results(finished)


def test_training_does_not_change_the_global_generator(
    small_dataset: PreparedDataset, roles: dict[str, Role], tmp_path: Path
) -> None:
    torch.manual_seed(5)
    expected = torch.rand(1)
    torch.manual_seed(5)
    train_run(config(recipe=RECIPE.model_copy(update={"epochs": 1})), small_dataset, roles, tmp_path / "run")
    assert torch.equal(torch.rand(1), expected)


def test_start_weights_must_fit(
    finished: Path, small_dataset: PreparedDataset, roles: dict[str, Role], tmp_path: Path
) -> None:
    weights = str(finished / "weights.safetensors")
    with pytest.raises(WeightsError) as caught:
        train_run(config(network="pointnet", start_from=weights), small_dataset, roles, tmp_path / "a")
    assert (str(caught.value.path), caught.value.expected) == (weights, "pointnet")
    with pytest.raises(WeightsError) as caught:
        train_run(config(heads=("door",), start_from=weights), small_dataset, roles, tmp_path / "heads")
    assert (str(caught.value.path), caught.value.expected) == (weights, "door")
    with pytest.raises(WeightsError, match="missing"):
        train_run(config(start_from="missing"), small_dataset, roles, tmp_path / "b")
    with pytest.raises(ConfigError) as no_epochs:
        train_run(
            config(recipe=RECIPE.model_copy(update={"epochs": 0})), small_dataset, roles, tmp_path / "c"
        )
    assert no_epochs.value.field == "epochs"


def test_validation_predictions_are_kept_for_calibration(finished: Path, roles: dict[str, Role]) -> None:
    rows = read_csv(finished / "validation.csv")
    assert {row["sample_id"] for row in rows} == {name for name, role in roles.items() if role == "val"}
    metrics = json.loads((finished / "metrics.json").read_text())
    correct = [row["state"] == row["predicted"] for row in rows]
    assert metrics["val_accuracy"] == pytest.approx(sum(correct) / len(correct))


def test_folder_of_another_run_is_refused(
    finished: Path, small_dataset: PreparedDataset, roles: dict[str, Role]
) -> None:
    with pytest.raises(RunError, match="fold, seed") as caught:
        train_run(config(seed=2, fold=1), small_dataset, roles, finished)
    assert (caught.value.path, caught.value.field) == (finished, "fold")


def test_damaged_checkpoint_is_refused_and_not_unpickled(
    small_dataset: PreparedDataset, roles: dict[str, Role], tmp_path: Path
) -> None:
    run = tmp_path / "run"
    train_run(config(recipe=RECIPE.model_copy(update={"epochs": 1})), small_dataset, roles, run)
    (run / "metrics.json").unlink()

    class Exploit:
        def __reduce__(self) -> tuple[Any, ...]:
            return (Path.touch, (tmp_path / "executed",))

    torch.save({"network": Exploit()}, run / "checkpoint.pt")
    with pytest.raises(RunError) as caught:
        train_run(config(recipe=RECIPE.model_copy(update={"epochs": 1})), small_dataset, roles, run)
    assert caught.value.path == run / "checkpoint.pt"
    assert not (tmp_path / "executed").exists()


def test_best_epoch_has_full_resolution(
    small_dataset: PreparedDataset, roles: dict[str, Role], tmp_path: Path
) -> None:
    recipe = RECIPE.model_copy(update={"coarse_to_fine": (CoarseStage(share=0.7, points=128),)})
    metrics = train_run(config(recipe=recipe, num_points=160), small_dataset, roles, tmp_path / "run")
    assert [line["points"] for line in read_csv(tmp_path / "run" / "log.csv")] == ["128", "128", "160"]
    assert metrics["best_epoch"] == 2


def test_infinite_loss_stops_the_run(
    small_dataset: PreparedDataset, roles: dict[str, Role], tmp_path: Path
) -> None:
    recipe = RECIPE.model_copy(
        update={"optimizer": "sgd", "learning_rate": 1e30, "gradient_clip": None, "warmup": 0.01}
    )
    with pytest.raises(RunError) as caught:
        train_run(config(recipe=recipe, network="dgcnn"), small_dataset, roles, tmp_path / "run")
    assert caught.value.path == tmp_path / "run"
    assert "learning_rate" in str(caught.value.hint)


def test_split_without_validation_samples_is_refused(small_dataset: PreparedDataset, tmp_path: Path) -> None:
    names = [row["sample_id"] for row in small_dataset.rows]
    unvalidated: dict[str, Role] = dict.fromkeys(names[:-5], "train") | dict.fromkeys(names[-5:], "test")  # type: ignore[assignment]
    with pytest.raises(DatasetError, match="0 samples for val"):
        train_run(config(), small_dataset, unvalidated, tmp_path / "run")


@pytest.mark.parametrize("name", ["pointnet", "dgcnn", "pointcnn", "point2sequence"])
def test_every_network_trains_with_the_recipe_of_its_authors(
    name: str, small_dataset: PreparedDataset, roles: dict[str, Role], tmp_path: Path
) -> None:
    recipe = AUTHORS[name].model_copy(update={"epochs": 1, "batch_size": 8})
    metrics = train_run(config(network=name, recipe=recipe), small_dataset, roles, tmp_path / "run")
    assert 0 <= metrics["test_macro_f1"] <= 1


def test_clouds_per_epoch_shortens_epochs_and_schedule(
    small_dataset: PreparedDataset,
    roles: dict[str, Role],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rates: list[float] = []
    train_step = Trainer.train_step

    def recorded(self: Trainer, batch: Batch) -> float:
        rates.append(self.optimizers[0].param_groups[0]["lr"])
        return train_step(self, batch)

    monkeypatch.setattr(Trainer, "train_step", recorded)
    recipe = RECIPE.model_copy(update={"clouds_per_epoch": 2 * RECIPE.batch_size + 1})
    train_run(config(recipe=recipe), small_dataset, roles, tmp_path / "run")
    assert len(rates) == 2 * RECIPE.epochs
    assert rates == pytest.approx([oracle_rate(recipe, iteration, 2, 128) for iteration in range(len(rates))])


@pytest.mark.parametrize(("scale", "kept"), [((1.0, 1.0), True), ((0.9, 1.1), False)])
def test_neighbours_searched_once_train_the_same_network(
    small_dataset: PreparedDataset,
    roles: dict[str, Role],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    scale: tuple[float, float],
    kept: bool,
) -> None:
    searched: list[int] = []
    search = PointNet2.neighbourhoods

    def recorded(self: PointNet2, points: torch.Tensor) -> tuple[torch.Tensor, ...]:
        searched.append(len(points))
        return search(self, points)

    monkeypatch.setattr(PointNet2, "neighbourhoods", recorded)
    recipe = RECIPE.model_copy(update={"augmentation": Augmentation(yaw_deg=10, mirror=0.5, scale=scale)})
    first = train_run(config(recipe=recipe), small_dataset, roles, tmp_path / "kept")
    clouds = {role: list(roles.values()).count(role) for role in ("train", "val", "test")}
    per_epoch = clouds["train"] // RECIPE.batch_size * RECIPE.batch_size
    expected = sum(clouds.values()) if kept else clouds["val"] + clouds["test"] + RECIPE.epochs * per_epoch
    assert abs(sum(searched) - expected) < RECIPE.batch_size  # a cloud may be left out of every epoch
    monkeypatch.setattr(Trainer, "neighbours_are_fixed", False)
    second = train_run(config(recipe=recipe), small_dataset, roles, tmp_path / "searched")
    assert {k: v for k, v in first.items() if k != "seconds"} == {
        k: v for k, v in second.items() if k != "seconds"
    }
    weights = [
        load_weights(tmp_path / run / "weights.safetensors")[0].state_dict() for run in ("kept", "searched")
    ]
    for name, value in weights[0].items():
        assert torch.equal(value, weights[1][name]), name


@pytest.mark.parametrize("works", [True, False])
def test_compilation_is_optional_and_falls_back(
    small_dataset: PreparedDataset,
    roles: dict[str, Role],
    finished: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    works: bool,
) -> None:
    calls: list[int] = []

    def fake_compile(function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            calls.append(1)
            if not works:
                raise TorchDynamoException("no C++ compiler\nlong story")
            return function(*arguments, **options)

        return call

    monkeypatch.setattr(torch, "compile", fake_compile)
    recipe = RECIPE.model_copy(update={"compile": True})
    metrics = train_run(config(recipe=recipe), small_dataset, roles, tmp_path / "compiled")
    expected = json.loads((finished / "metrics.json").read_text(encoding="utf-8"))
    assert metrics["test_macro_f1"] == expected["test_macro_f1"]
    assert (len(calls) > 1) == works
    warnings = [record.getMessage() for record in caplog.records if record.name.startswith("doorstate")]
    assert len(warnings) == (0 if works else 1)
    assert all("no C++ compiler" in warning for warning in warnings)


@pytest.fixture(scope="module")
def scene_roles(scene_dataset: PreparedDataset) -> dict[str, Role]:
    """Return a fold with doors for validation, and with doors and scenes without one for testing."""
    without = {row["sample_id"] for row in scene_dataset.rows if row["state"] == "no_door"}
    for roles in draw_splits(scene_dataset.rows, "by-scene", 0):
        tested = {sample for sample, role in roles.items() if role == "test"}
        if (
            {s for s, role in roles.items() if role == "val"} - without
            and tested - without
            and tested & without
        ):
            return roles
    raise AssertionError("no such fold")


@pytest.mark.parametrize("network", ["pointnet2", "pointcnn"])
def test_heads_are_trained_jointly_and_written_in_metres(
    network: str, scene_dataset: PreparedDataset, scene_roles: dict[str, Role], tmp_path: Path
) -> None:
    heads = ("door", "angle", "hinge", "frame", "widths", *(("parts",) if network == "pointnet2" else ()))
    recipe = RECIPE.model_copy(update={"epochs": 2, "coarse_to_fine": (CoarseStage(share=0.5, points=128),)})
    run = config(network=network, heads=heads, recipe=recipe, protocol="by-scene", num_points=160)
    metrics = train_run(run, scene_dataset, scene_roles, tmp_path)
    tested = [sample for sample, role in scene_roles.items() if role == "test"]
    rows = read_csv(tmp_path / "head_outputs.csv")
    assert [row["sample_id"] for row in rows] == tested
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


def test_head_of_loss_weight_0_is_not_trained(
    scene_dataset: PreparedDataset, scene_roles: dict[str, Role], tmp_path: Path
) -> None:
    changes = {"epochs": 1, "augmentation": Augmentation()}
    networks = []
    for weights in ({}, {"hinge": 0.0}, {"state": 4.0, "hinge": 0.0}):
        recipe = RECIPE.model_copy(update=changes | {"weight_decay": 0.0, "loss_weights": weights})
        folder = tmp_path / str(len(networks))
        train_run(config(heads=("door", "hinge"), recipe=recipe), scene_dataset, scene_roles, folder)
        networks.append(load_weights(folder / "weights.safetensors")[0])

    def hinge(network: torch.nn.Module) -> torch.Tensor:
        return network.get_parameter("heads.hinge.linear.weight")

    def head(network: torch.nn.Module) -> torch.Tensor:
        return torch.cat([weight.flatten() for weight in network.get_submodule("head").parameters()])

    assert not torch.equal(hinge(networks[0]), hinge(networks[1]))
    assert torch.equal(hinge(networks[1]), hinge(networks[2])), "initial weights"
    assert not torch.equal(head(networks[1]), head(networks[2]))


def test_run_with_other_heads_is_refused(
    scene_dataset: PreparedDataset, scene_roles: dict[str, Role], tmp_path: Path
) -> None:
    run = config(heads=("door", "frame"), recipe=RECIPE.model_copy(update={"epochs": 1}))
    train_run(run, scene_dataset, scene_roles, tmp_path)
    with pytest.raises(RunError) as caught:
        train_run(
            config(recipe=RECIPE.model_copy(update={"epochs": 1})), scene_dataset, scene_roles, tmp_path
        )
    assert caught.value.field == "heads"


def test_scenes_without_a_door_need_the_door_head(
    scene_dataset: PreparedDataset, scene_roles: dict[str, Role], tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match="door"):
        train_run(config(heads=("angle",)), scene_dataset, scene_roles, tmp_path)


def test_validation_samples_without_a_door_are_refused(
    scene_dataset: PreparedDataset, scene_roles: dict[str, Role], tmp_path: Path
) -> None:
    doorless = {
        s: "unused" if r == "val" and not s.endswith("no_door") else r for s, r in scene_roles.items()
    }
    doorless |= {row["sample_id"]: "val" for row in scene_dataset.rows[-2:]}
    with pytest.raises(DatasetError, match="door for val"):
        train_run(config(heads=("door",)), scene_dataset, doorless, tmp_path)  # type: ignore[arg-type]
