# SPDX-License-Identifier: Apache-2.0
"""Training loop: exact continuation after a stop, best epoch, batches, neighbours, loss weights."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from doorstate._files import read_csv
from doorstate.clouds.augmentation import Augmentation
from doorstate.clouds.corruption import Corruption
from doorstate.dataset.loader import Batch
from doorstate.dataset.roles import Role
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import RunError
from doorstate.networks.pointnet2 import PointNet2
from doorstate.networks.weights import load_weights
from doorstate.training import trainer as trainer_module
from doorstate.training.recipes import CoarseStage
from doorstate.training.run import train_run
from doorstate.training.trainer import Trainer
from tests.training.runs import RECIPE, read_results, run_config
from tests.training.test_schedules import oracle_rate


def train_until(
    epoch: int,
    dataset: PreparedDataset,
    fold_roles: dict[str, Role],
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
            train_run(run_config(), dataset, fold_roles, folder)


@pytest.mark.parametrize("stop_after", [1, 2])
def test_run_stopped_between_epochs_continues_exactly(
    stop_after: int,
    finished_run: Path,
    small_dataset: PreparedDataset,
    fold_roles: dict[str, Role],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    train_until(stop_after, small_dataset, fold_roles, tmp_path / "run", monkeypatch)
    assert (tmp_path / "run" / "checkpoint.pt").is_file()
    torch.manual_seed(99)  # the state of the global generator must not matter
    train_run(run_config(), small_dataset, fold_roles, tmp_path / "run")
    assert read_results(tmp_path / "run") == read_results(finished_run)


def test_run_stopped_within_an_epoch_continues_exactly(
    finished_run: Path,
    small_dataset: PreparedDataset,
    fold_roles: dict[str, Role],
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
            train_run(run_config(), small_dataset, fold_roles, tmp_path / "run")
    steps = -100
    with monkeypatch.context() as patch:
        patch.setattr(Trainer, "train_step", train_step)
        train_run(run_config(), small_dataset, fold_roles, tmp_path / "run")
    assert steps == -100 + 9 - 5, "only the remaining steps"
    assert read_results(tmp_path / "run") == read_results(finished_run)


def test_best_epoch_has_full_resolution(
    small_dataset: PreparedDataset, fold_roles: dict[str, Role], tmp_path: Path
) -> None:
    recipe = RECIPE.model_copy(update={"coarse_to_fine": (CoarseStage(share=0.7, points=128),)})
    metrics = train_run(
        run_config(recipe=recipe, num_points=160), small_dataset, fold_roles, tmp_path / "run"
    )
    assert [line["points"] for line in read_csv(tmp_path / "run" / "log.csv")] == ["128", "128", "160"]
    assert metrics["best_epoch"] == 2


def test_infinite_loss_stops_the_run(
    small_dataset: PreparedDataset, fold_roles: dict[str, Role], tmp_path: Path
) -> None:
    recipe = RECIPE.model_copy(
        update={"optimizer": "sgd", "learning_rate": 1e30, "gradient_clip": None, "warmup": 0.01}
    )
    with pytest.raises(RunError) as caught:
        train_run(run_config(recipe=recipe, network="dgcnn"), small_dataset, fold_roles, tmp_path / "run")
    assert caught.value.path == tmp_path / "run"
    assert "learning_rate" in str(caught.value.hint)


def test_clouds_per_epoch_shortens_epochs_and_schedule(
    small_dataset: PreparedDataset,
    fold_roles: dict[str, Role],
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
    train_run(run_config(recipe=recipe), small_dataset, fold_roles, tmp_path / "run")
    assert len(rates) == 2 * RECIPE.epochs
    assert rates == pytest.approx([oracle_rate(recipe, iteration, 2, 128) for iteration in range(len(rates))])


@pytest.mark.parametrize(("scale", "kept"), [((1.0, 1.0), True), ((0.9, 1.1), False)])
def test_neighbours_searched_once_train_the_same_network(
    small_dataset: PreparedDataset,
    fold_roles: dict[str, Role],
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
    first = train_run(run_config(recipe=recipe), small_dataset, fold_roles, tmp_path / "kept")
    clouds = {role: list(fold_roles.values()).count(role) for role in ("train", "val", "test")}
    per_epoch = clouds["train"] // RECIPE.batch_size * RECIPE.batch_size
    expected = sum(clouds.values()) if kept else clouds["val"] + clouds["test"] + RECIPE.epochs * per_epoch
    assert abs(sum(searched) - expected) < RECIPE.batch_size  # a cloud may be left out of every epoch
    monkeypatch.setattr(Trainer, "neighbours_are_fixed", False)
    second = train_run(run_config(recipe=recipe), small_dataset, fold_roles, tmp_path / "searched")
    assert {k: v for k, v in first.items() if k != "seconds"} == {
        k: v for k, v in second.items() if k != "seconds"
    }
    weights = [
        load_weights(tmp_path / run / "weights.safetensors")[0].state_dict() for run in ("kept", "searched")
    ]
    for name, value in weights[0].items():
        assert torch.equal(value, weights[1][name]), name


@pytest.mark.parametrize(("losses", "fixed"), [({}, True), ({"holes": 0.1}, False)])
def test_corruption_changes_neighbours(losses: dict[str, float], fixed: bool) -> None:
    trainer = Trainer.__new__(Trainer)
    recipe = RECIPE.model_copy(update={"augmentation": Augmentation(), "corruption": Corruption(**losses)})
    trainer.config, trainer.network = run_config(recipe=recipe), PointNet2()
    assert trainer.neighbours_are_fixed is fixed


def test_head_of_loss_weight_0_is_not_trained(
    scene_dataset: PreparedDataset, scene_roles: dict[str, Role], tmp_path: Path
) -> None:
    changes = {"epochs": 1, "augmentation": Augmentation()}
    networks = []
    for weights in ({}, {"hinge": 0.0}, {"state": 4.0, "hinge": 0.0}):
        recipe = RECIPE.model_copy(update=changes | {"weight_decay": 0.0, "loss_weights": weights})
        folder = tmp_path / str(len(networks))
        train_run(run_config(heads=("door", "hinge"), recipe=recipe), scene_dataset, scene_roles, folder)
        networks.append(load_weights(folder / "weights.safetensors")[0])

    def hinge(network: torch.nn.Module) -> torch.Tensor:
        return network.get_parameter("heads.hinge.linear.weight")

    def head(network: torch.nn.Module) -> torch.Tensor:
        return torch.cat([weight.flatten() for weight in network.get_submodule("head").parameters()])

    assert not torch.equal(hinge(networks[0]), hinge(networks[1]))
    assert torch.equal(hinge(networks[1]), hinge(networks[2])), "initial weights"
    assert not torch.equal(head(networks[1]), head(networks[2]))
