# SPDX-License-Identifier: Apache-2.0
"""Comparisons: splits, weights to start from, additional data, and continuation after SIGKILL."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from doorstate._files import read_csv
from doorstate.dataset.splits import read_splits
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import ConfigError, RunError
from doorstate.networks.card_file import read_card
from doorstate.training.comparison import compare, plan_runs, prepare_comparison
from doorstate.training.experiment import Experiment
from tests.training.runs import CHANGES, small_experiment


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def test_runs_start_from_the_weights_of_another_comparison(
    small_dataset: PreparedDataset, tmp_path: Path
) -> None:
    first = small_experiment(small_dataset, folds=1, recipe_changes=CHANGES | {"epochs": 1})
    compare(first, tmp_path / "first")
    again = first.model_copy(
        update={"start_from": str(tmp_path / "first"), "recipe_changes": CHANGES | {"epochs": 0}}
    )
    compare(again, tmp_path / "again")
    first_results, results = read_results(tmp_path / "first"), read_results(tmp_path / "again")
    cards = [
        read_card(tmp_path / name / "runs" / "pointnet2" / "fold0" / "weights.safetensors")
        for name in ("first", "again")
    ]
    assert cards[0] == cards[1], "the card still says what the weights were trained on"
    name = "runs/pointnet2/fold0/predictions.csv"
    assert first_results[name] == results[name]


def test_networks_without_earlier_weights_start_from_random_weights(
    small_dataset: PreparedDataset, tmp_path: Path
) -> None:
    first = small_experiment(small_dataset, folds=1, recipe_changes=CHANGES | {"epochs": 1})
    compare(first, tmp_path / "first")
    both = {"networks": ("pointnet", "pointnet2"), "start_from": str(tmp_path / "first")}
    compare(first.model_copy(update=both), tmp_path / "again")
    start_from = {
        network: json.loads((tmp_path / f"again/runs/{network}/fold0/config.json").read_text())["start_from"]
        for network in both["networks"]
    }
    assert start_from == {
        "pointnet": None,
        "pointnet2": str(tmp_path / "first/runs/pointnet2/fold0/weights.safetensors"),
    }
    with pytest.raises(RunError) as missing:
        compare(first.model_copy(update={"start_from": str(tmp_path / "gone")}), tmp_path / "after")
    assert missing.value.path == tmp_path / "gone"
    with pytest.raises(RunError, match="pointnet"):
        prepare_comparison(first.model_copy(update=both | {"networks": ("pointnet",)}), tmp_path / "other")


def test_training_on_all_samples_tests_none(small_dataset: PreparedDataset, tmp_path: Path) -> None:
    everything = small_experiment(
        small_dataset, protocol="all", folds=1, recipe_changes=CHANGES | {"epochs": 2}
    )
    (metrics,) = compare(everything, tmp_path / "c")
    assert metrics["train_samples"] == len(small_dataset)
    assert metrics["best_epoch"] == 1, "the last epoch"
    assert "test_macro_f1" not in metrics
    folder = tmp_path / "c" / "runs" / "pointnet2" / "fold0"
    assert not (folder / "predictions.csv").exists()
    assert (folder / "weights.safetensors").is_file()


def test_split_is_drawn_once(small_dataset: PreparedDataset, tmp_path: Path) -> None:
    prepare_comparison(small_experiment(small_dataset), tmp_path / "c")
    before = (tmp_path / "c" / "splits.csv").read_bytes()
    prepare_comparison(small_experiment(small_dataset), tmp_path / "c")
    assert (tmp_path / "c" / "splits.csv").read_bytes() == before
    assert len(read_splits(tmp_path / "c" / "splits.csv")) == 5


def test_folder_of_another_comparison_is_refused(small_dataset: PreparedDataset, tmp_path: Path) -> None:
    prepare_comparison(small_experiment(small_dataset), tmp_path / "c")
    with pytest.raises(RunError) as caught:
        prepare_comparison(small_experiment(small_dataset, seed=1), tmp_path / "c")
    assert (caught.value.path, caught.value.field) == (tmp_path / "c", "seed")


def test_scenes_without_a_door_need_the_door_head(scene_dataset: PreparedDataset, tmp_path: Path) -> None:
    experiment = Experiment(
        name="x", dataset=str(scene_dataset.folder), protocol="by-scene", folds=1, networks=("pointnet",)
    )
    with pytest.raises(ConfigError, match="12 samples"):
        prepare_comparison(experiment, tmp_path / "run")
    assert not (tmp_path / "run").exists()
    prepare_comparison(experiment.model_copy(update={"heads": ("door",)}), tmp_path / "run")


def test_runs_are_planned_fold_by_fold(small_dataset: PreparedDataset, tmp_path: Path) -> None:
    both = small_experiment(small_dataset, networks=("pointnet", "dgcnn"))
    assert [(run.method, run.fold) for run in plan_runs(both, tmp_path)] == [
        ("pointnet", 0),
        ("dgcnn", 0),
        ("pointnet", 1),
        ("dgcnn", 1),
    ]


def read_results(folder: Path) -> dict[str, Any]:
    """Return metrics, without durations, and predictions of all runs by file."""
    results: dict[str, Any] = {}
    for path in sorted(folder.rglob("metrics.json")):
        metrics = json.loads(path.read_text())
        metrics.pop("seconds")
        results[str(path.relative_to(folder))] = metrics
        predictions = path.with_name("predictions.csv")
        results[str(predictions.relative_to(folder))] = read_csv(predictions)
    return results


SCRIPT = """
import sys
from pathlib import Path
import torch
from doorstate.training.comparison import compare
from doorstate.training.experiment import Experiment

if __name__ == "__main__":
    torch.set_num_threads(1)
    experiment = Experiment.model_validate_json(Path(sys.argv[1]).read_text())
    compare(experiment, Path(sys.argv[2]), jobs=int(sys.argv[3]))
"""


@pytest.fixture(scope="module")
def undisturbed(small_dataset: PreparedDataset, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("undisturbed")
    subprocess.run(comparison_command(small_dataset, folder, jobs=1), check=True, timeout=300)
    return read_results(folder / "out")


def comparison_command(dataset: PreparedDataset, folder: Path, jobs: int) -> list[str]:
    """Return the command of a comparison into `out`; it has one thread of its own, whatever this process has."""
    experiment = write(folder / "experiment.json", small_experiment(dataset).model_dump_json())
    return [
        sys.executable,
        *map(str, (write(folder / "script.py", SCRIPT), experiment, folder / "out", jobs)),
    ]


def wait_for_group(group: int, timeout_s: float) -> None:
    """Wait until all processes of a group have ended, at most the given time: an orphan may stay a zombie."""
    end_s = time.monotonic() + timeout_s
    with contextlib.suppress(ProcessLookupError):
        while time.monotonic() < end_s:
            os.killpg(group, 0)
            time.sleep(0.05)


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_killed_comparison_continues_exactly(
    jobs: int, small_dataset: PreparedDataset, undisturbed: dict[str, Any], tmp_path: Path
) -> None:
    command = comparison_command(small_dataset, tmp_path, jobs)
    process = subprocess.Popen(command, start_new_session=True)
    deadline = time.monotonic() + 120
    while not list((tmp_path / "out").rglob("checkpoint.pt")):
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    wait_for_group(process.pid, 10.0)  # its workers end too
    assert len(read_results(tmp_path / "out")) < 4, "killed after the last run"

    subprocess.run(command, check=True, timeout=300)
    assert read_results(tmp_path / "out") == undisturbed
    assert len(undisturbed) == 4


def test_additional_data_is_trained_on_in_every_fold_and_never_tested(
    small_dataset: PreparedDataset, more_dataset: PreparedDataset, tmp_path: Path
) -> None:
    plain = small_experiment(small_dataset, recipe_changes=CHANGES | {"epochs": 1})
    more = plain.model_copy(update={"extra_train_datasets": (str(more_dataset.folder),)})
    plain_metrics, more_metrics = compare(plain, tmp_path / "plain"), compare(more, tmp_path / "more")
    for first, second in zip(plain_metrics, more_metrics, strict=True):
        assert second["train_samples"] == first["train_samples"] + len(more_dataset)
        assert second["val_samples"] == first["val_samples"]
        assert second["test_samples"] == first["test_samples"]
    for fold in (0, 1):
        tested = [
            read_csv(tmp_path / name / f"runs/pointnet2/fold{fold}/predictions.csv")
            for name in ("plain", "more")
        ]
        assert [row["sample_id"] for row in tested[0]] == [row["sample_id"] for row in tested[1]]
        assert tested[0] != tested[1]
    card = read_card(tmp_path / "more/runs/pointnet2/fold0/weights.safetensors")
    assert str(len(more_dataset)) in card.trained_on
    only_tested = {"start_from": str(tmp_path / "plain"), "recipe_changes": CHANGES | {"epochs": 0}}
    tested_metrics = compare(more.model_copy(update=only_tested), tmp_path / "tested")
    assert [run["train_samples"] for run in tested_metrics] == [run["train_samples"] for run in plain_metrics]
