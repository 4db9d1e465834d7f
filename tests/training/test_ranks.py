# SPDX-License-Identifier: Apache-2.0
"""One network trained by two processes: the same gradients, statistics, weights and files as by one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import torch

from doorstate._files import read_csv
from doorstate.dataset.roles import Role
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import ConfigError
from doorstate.networks.weights import load_weights
from doorstate.training.ranks import ALONE, Ranks, check_devices, is_rank, joined_ranks
from doorstate.training.run import train_run
from tests.training.runs import RECIPE, read_results, run_config
from tests.training.two_ranks import (
    NETWORKS,
    no_dropout,
    quiet_config,
    run_in_two_processes,
    training_step,
    write_steps_and_runs,
)


@pytest.fixture(scope="module")
def two_ranks(
    small_dataset: PreparedDataset, fold_roles: dict[str, Role], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """Folder of everything that two processes wrote."""
    folder = tmp_path_factory.mktemp("ranks")
    run_in_two_processes(write_steps_and_runs, folder, small_dataset.folder, fold_roles)
    return folder


@pytest.mark.parametrize("name", NETWORKS)
def test_a_step_of_two_ranks_is_that_of_one(two_ranks: Path, name: str) -> None:
    expected = training_step(name, ALONE)
    for rank in range(2):
        got = torch.load(two_ranks / f"steps{rank}.pt")[name]
        assert got.keys() == expected.keys()
        for key, value in expected.items():
            torch.testing.assert_close(
                got[key], value, rtol=1e-8, atol=1e-9, msg=lambda m, key=key: f"{key}: {m}"
            )


def test_a_run_of_two_ranks_is_that_of_one_within_rounding(
    two_ranks: Path, small_dataset: PreparedDataset, fold_roles: dict[str, Role], tmp_path: Path
) -> None:
    with no_dropout():
        train_run(quiet_config(), small_dataset, fold_roles, tmp_path / "one", device="cpu")
    one, two = (read_csv(folder / "log.csv") for folder in (tmp_path / "one", two_ranks / "whole"))
    for expected, got in zip(one, two, strict=True):
        assert got["lr"] == expected["lr"]
        assert float(got["train_loss"]) == pytest.approx(float(expected["train_loss"]), rel=1e-3)
    networks = [
        load_weights(folder / "weights.safetensors")[0] for folder in (tmp_path / "one", two_ranks / "whole")
    ]
    for name, value in networks[0].state_dict().items():
        torch.testing.assert_close(
            networks[1].state_dict()[name],
            value,
            rtol=1e-3,
            atol=1e-3,
            msg=lambda m, name=name: f"{name}: {m}",
        )


def test_a_stopped_run_of_two_ranks_continues_exactly(two_ranks: Path) -> None:
    assert read_results(two_ranks / "stopped") == read_results(two_ranks / "whole")


def test_ranks_share_batches_equally(
    small_dataset: PreparedDataset,
    fold_roles: dict[str, Role],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Ranks, "agree", lambda self, value: value)
    config = run_config(recipe=RECIPE.model_copy(update={"batch_size": 7}))
    with pytest.raises(ConfigError) as refused:
        train_run(config, small_dataset, fold_roles, tmp_path, (), "cpu", Ranks(0, 2))
    assert (refused.value.field, refused.value.expected) == ("batch_size", "a multiple of 2")


def test_a_process_alone_has_no_ranks() -> None:
    assert not is_rank()
    with joined_ranks("cpu") as (device, ranks):
        assert (device.type, ranks, ranks.is_first) == ("cpu", ALONE, True)
    check_devices("cpu", 64)


def test_train_starts_its_ranks(small_dataset: PreparedDataset, tmp_path: Path) -> None:
    out = tmp_path / "run"
    options = [
        "--points",
        "128",
        "--epochs",
        "1",
        "--set",
        "batch_size=8",
        "--device",
        "cpu",
        "--devices",
        "2",
    ]
    command = [sys.executable, "-m", "doorstate", "train", "--network", "pointnet", "--json", *options]
    command += ["--data", str(small_dataset.folder), "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("test_macro_f1") == 1, "the first rank alone prints"
    assert '"ranks": 2' in (out / "environment.json").read_text()
