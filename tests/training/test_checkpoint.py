# SPDX-License-Identifier: Apache-2.0
"""Damaged checkpoints."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch

from doorstate.dataset.roles import Role
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import OutputError, RunError
from doorstate.training.run import train_run
from doorstate.training.run_folder import RunFolder
from tests.full_disk import full_disk
from tests.training.runs import RECIPE, run_config


def test_damaged_checkpoint_is_refused_and_not_unpickled(
    small_dataset: PreparedDataset, fold_roles: dict[str, Role], tmp_path: Path
) -> None:
    run = tmp_path / "run"
    train_run(run_config(recipe=RECIPE.model_copy(update={"epochs": 1})), small_dataset, fold_roles, run)
    (run / "metrics.json").unlink()

    class Exploit:
        def __reduce__(self) -> tuple[Any, ...]:
            return (Path.touch, (tmp_path / "executed",))

    torch.save({"network": Exploit()}, run / "checkpoint.pt")
    with pytest.raises(RunError) as caught:
        train_run(run_config(recipe=RECIPE.model_copy(update={"epochs": 1})), small_dataset, fold_roles, run)
    assert caught.value.path == run / "checkpoint.pt"
    assert not (tmp_path / "executed").exists()


@pytest.mark.parametrize(
    "edit",
    [
        lambda content: content.pop("network"),
        lambda content: content["network"].popitem(),
        lambda content: next(iter(content["network"].values())).fill_(torch.nan),
        lambda content: content["optimizers"].clear(),
        lambda content: content["optimizers"][0]["state"][0].update(exp_avg=torch.zeros(3)),
        lambda content: content["schedule"].clear(),
        lambda content: content.update(log=5),
        lambda content: content.update(best_score=[1.0]),
        lambda content: content.update(best_epoch="first"),
        lambda content: content.update(progress=[[1.0], 0.1, torch.zeros(3), 1.0]),
    ],
)
def test_edited_checkpoints_are_refused(
    finished_epoch: Path,
    edit: Callable[[dict[str, Any]], object],
    small_dataset: PreparedDataset,
    fold_roles: dict[str, Role],
    tmp_path: Path,
) -> None:
    shutil.copytree(finished_epoch, tmp_path / "run")
    content = torch.load(tmp_path / "run" / "checkpoint.pt", weights_only=True)
    edit(content)
    torch.save(content, tmp_path / "run" / "checkpoint.pt")
    with pytest.raises(RunError) as caught:
        train_run(run_config(), small_dataset, fold_roles, tmp_path / "run")
    assert caught.value.path == tmp_path / "run" / "checkpoint.pt"


def test_a_full_disk_is_an_error_in_one_line(
    finished_epoch: Path, small_dataset: PreparedDataset, fold_roles: dict[str, Role], tmp_path: Path
) -> None:
    shutil.copytree(finished_epoch, tmp_path / "run")
    before = (tmp_path / "run" / "checkpoint.pt").read_bytes()
    with pytest.raises(OutputError), full_disk(tmp_path):
        train_run(run_config(), small_dataset, fold_roles, tmp_path / "run")
    assert (tmp_path / "run" / "checkpoint.pt").read_bytes() == before


@pytest.fixture(scope="module")
def finished_epoch(
    small_dataset: PreparedDataset,
    fold_roles: dict[str, Role],
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    """Folder of a run that was stopped after its first epoch."""
    folder = tmp_path_factory.mktemp("stopped") / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(RunFolder, "write_log", _interrupt)
        with pytest.raises(KeyboardInterrupt):
            train_run(run_config(), small_dataset, fold_roles, folder)
    return folder


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt
