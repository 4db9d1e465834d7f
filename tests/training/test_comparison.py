# SPDX-License-Identifier: Apache-2.0
"""Comparisons: experiment files, folders, and a real kill -9."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from doorstate._files import read_csv
from doorstate.dataset.splits import read_splits
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import ConfigError, DatasetError, RunError
from doorstate.networks.weights import read_card
from doorstate.training.comparison import Experiment, compare, load_experiment, plan_runs, prepare_comparison
from doorstate.training.resolution import load_study
from doorstate.training.transfer import load_transfer

CHANGES = {"epochs": 4, "batch_size": 8, "precision": "fp32"}


def experiment(dataset: PreparedDataset, **changes: Any) -> Experiment:
    values = {
        "name": "test",
        "dataset": str(dataset.folder),
        "networks": ("pointnet2",),
        "folds": 2,
        "num_points": 128,
        "recipe_changes": CHANGES,
    }
    return Experiment.model_validate(values | changes)


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def test_options_win_over_the_file_and_the_file_over_defaults(tmp_path: Path) -> None:
    path = write(
        tmp_path / "mine.toml",
        'dataset = "d"\nnum_points = 512\nseed = 4\n[recipe_changes]\nepochs = 5\nbatch_size = 4\n',
    )
    found = load_experiment(path, {"num_points": 256, "recipe_changes": {"epochs": 7}})
    assert (found.name, found.num_points, found.seed, found.folds) == ("mine", 256, 4, 5)
    assert found.recipe_changes == {"epochs": 7, "batch_size": 4}
    assert found.recipe_of("pointnet").epochs == 7


def test_a_network_may_differ_and_options_win_over_that_too(tmp_path: Path) -> None:
    path = write(
        tmp_path / "mine.toml",
        'dataset = "d"\n[recipe_changes]\nepochs = 5\n[network_changes.dgcnn]\nepochs = 3\nbatch_size = 4\n',
    )
    found = load_experiment(path, {})
    assert [found.recipe_of(network).epochs for network in ("pointnet", "dgcnn")] == [5, 3]
    found = load_experiment(path, {"recipe_changes": {"epochs": 7}})
    assert [found.recipe_of(network).epochs for network in ("pointnet", "dgcnn")] == [7, 7]
    assert found.recipe_of("dgcnn").batch_size == 4


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("dataset = ", "cannot be read as an experiment"),
        ("x = 1", "Extra inputs are not permitted|Field required"),
        ('dataset = "d"\nnetworks = ["pointnett"]', "did you mean 'pointnet'"),
        ('dataset = "d"\nprotocol = "random"', "choose one of paper, by-pose"),
        ('dataset = "d"\nrecipe = "best"', "choose common or authors"),
        ('dataset = "d"\n[recipe_changes]\nepoch = 3', "recipe_changes: epoch: Extra inputs"),
        ('dataset = "d"\nrecipe_changes = 3', "recipe_changes: Input should be a valid dictionary"),
        ('dataset = "d"\n[network_changes.pointnett]\nepochs = 3', "no network 'pointnett'"),
        ('dataset = "d"\n[network_changes.dgcnn]\nepoch = 3', "recipe_changes: epoch: Extra inputs"),
        ('dataset = "d"\nprotocol = "all"', "protocol all has one fold: set folds = 1"),
        ('dataset = "d"\nprotocol = "unseen"', "protocol unseen has one fold: set folds = 1"),
        ('dataset = "d"\nprotocol = "unseen"\nfolds = 1', "protocol unseen trains nothing"),
        (
            'dataset = "d"\nheads = ["door"]\nrecipe_changes = {loss_weights = {angle = 2}}',
            "has no head 'angle': it learns state, door",
        ),
        ('dataset = "d"\nfolds = 6', "folds: Input should be less than or equal to 5"),
    ],
)
def test_a_wrong_experiment_is_one_line(text: str, complaint: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=complaint) as caught:
        load_experiment(write(tmp_path / "mine.toml", text), {})
    assert "\n" not in str(caught.value)


def test_a_missing_experiment_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"gone\.toml"):
        load_experiment(tmp_path / "gone.toml", {})


@pytest.mark.parametrize(
    "path", sorted(Path(__file__).parents[2].glob("paper/experiments/*.toml")), ids=lambda p: p.name
)
def test_the_experiments_of_the_repository_are_valid(path: Path) -> None:
    asked = tomllib.loads(path.read_text())
    load = load_study if "points" in asked else load_transfer if "tested" in asked else None
    read = load_experiment(path, {}) if load is None else load(path)
    assert read.name == path.stem
    if isinstance(read, Experiment):
        read.check()


def test_runs_go_on_from_the_weights_of_another_comparison(
    small_dataset: PreparedDataset, tmp_path: Path
) -> None:
    first = experiment(small_dataset, folds=1, recipe_changes=CHANGES | {"epochs": 1})
    compare(first, tmp_path / "first")
    again = first.model_copy(
        update={"start_from": str(tmp_path / "first"), "recipe_changes": CHANGES | {"epochs": 0}}
    )
    compare(again, tmp_path / "again")
    one, other = outcome(tmp_path / "first"), outcome(tmp_path / "again")
    cards = [
        read_card(tmp_path / name / "runs" / "pointnet2" / "fold0" / "weights.safetensors")
        for name in ("first", "again")
    ]
    assert cards[0] == cards[1], "weights that are only tested stay what they were trained on"
    name = "runs/pointnet2/fold0/predictions.csv"
    assert one[name] == other[name]


def test_networks_that_the_other_comparison_lacks_begin_anew(
    small_dataset: PreparedDataset, tmp_path: Path
) -> None:
    first = experiment(small_dataset, folds=1, recipe_changes=CHANGES | {"epochs": 1})
    compare(first, tmp_path / "first")
    both = {"networks": ("pointnet", "pointnet2"), "start_from": str(tmp_path / "first")}
    compare(first.model_copy(update=both), tmp_path / "again")
    began = {
        network: json.loads((tmp_path / f"again/runs/{network}/fold0/config.json").read_text())["start_from"]
        for network in both["networks"]
    }
    assert began == {
        "pointnet": None,
        "pointnet2": str(tmp_path / "first/runs/pointnet2/fold0/weights.safetensors"),
    }
    with pytest.raises(RunError, match="no such comparison; run it first"):
        compare(first.model_copy(update={"start_from": str(tmp_path / "gone")}), tmp_path / "after")
    with pytest.raises(RunError, match="has none of pointnet to go on from"):
        prepare_comparison(first.model_copy(update=both | {"networks": ("pointnet",)}), tmp_path / "other")


def test_weights_that_have_learned_what_is_tested_are_not_gone_on_from(
    small_dataset: PreparedDataset, tmp_path: Path
) -> None:
    prepare_comparison(experiment(small_dataset), tmp_path / "first")
    other = experiment(small_dataset, protocol="all", folds=1)
    prepare_comparison(other, tmp_path / "all")
    for name, complains in (("first", False), ("all", True)):
        again = experiment(small_dataset, start_from=str(tmp_path / name))
        with pytest.raises(RunError, match="which is tested here") if complains else nullcontext():
            prepare_comparison(again, tmp_path / f"after-{name}")
    same_names = tmp_path / "of-another-seed"
    shutil.copytree(small_dataset.folder, same_names)
    elsewhere = {"start_from": str(tmp_path / "all"), "dataset": str(same_names)}
    prepare_comparison(experiment(small_dataset).model_copy(update=elsewhere), tmp_path / "elsewhere")


def test_training_on_everything_tests_nothing(small_dataset: PreparedDataset, tmp_path: Path) -> None:
    everything = experiment(small_dataset, protocol="all", folds=1, recipe_changes=CHANGES | {"epochs": 2})
    (metrics,) = compare(everything, tmp_path / "c")
    assert metrics["train_samples"] == len(small_dataset)
    assert metrics["best_epoch"] == 1, "the last"
    assert "test_macro_f1" not in metrics
    folder = tmp_path / "c" / "runs" / "pointnet2" / "fold0"
    assert not (folder / "predictions.csv").exists()
    assert (folder / "weights.safetensors").is_file()


def test_the_split_is_drawn_once(small_dataset: PreparedDataset, tmp_path: Path) -> None:
    prepare_comparison(experiment(small_dataset), tmp_path / "c")
    before = (tmp_path / "c" / "splits.csv").read_bytes()
    prepare_comparison(experiment(small_dataset), tmp_path / "c")
    assert (tmp_path / "c" / "splits.csv").read_bytes() == before
    assert len(read_splits(tmp_path / "c" / "splits.csv")) == 5


def test_another_comparison_in_the_same_folder_is_refused(
    small_dataset: PreparedDataset, tmp_path: Path
) -> None:
    prepare_comparison(experiment(small_dataset), tmp_path / "c")
    with pytest.raises(RunError, match="another seed; choose another folder"):
        prepare_comparison(experiment(small_dataset, seed=1), tmp_path / "c")


def test_scenes_without_a_door_are_refused_before_anything_is_written(
    scene_dataset: PreparedDataset, tmp_path: Path
) -> None:
    experiment = Experiment(
        name="x", dataset=str(scene_dataset.folder), protocol="by-scene", folds=1, networks=("pointnet",)
    )
    with pytest.raises(ConfigError, match=r"12 samples show no door, .* add the head 'door'"):
        prepare_comparison(experiment, tmp_path / "run")
    assert not (tmp_path / "run").exists()
    prepare_comparison(experiment.model_copy(update={"heads": ("door",)}), tmp_path / "run")


def test_runs_go_fold_by_fold(small_dataset: PreparedDataset, tmp_path: Path) -> None:
    both = experiment(small_dataset, networks=("pointnet", "dgcnn"))
    assert [(run.method, run.fold) for run in plan_runs(both, tmp_path)] == [
        ("pointnet", 0),
        ("dgcnn", 0),
        ("pointnet", 1),
        ("dgcnn", 1),
    ]


def outcome(folder: Path) -> dict[str, Any]:
    """Everything a comparison found; not how long it took."""
    found: dict[str, Any] = {}
    for path in sorted(folder.rglob("metrics.json")):
        metrics = json.loads(path.read_text())
        metrics.pop("seconds")
        found[str(path.relative_to(folder))] = metrics
        predictions = path.with_name("predictions.csv")
        found[str(predictions.relative_to(folder))] = read_csv(predictions)
    return found


SCRIPT = """
import sys
from pathlib import Path
import torch
from doorstate.training.comparison import Experiment, compare

if __name__ == "__main__":
    torch.set_num_threads(1)
    experiment = Experiment.model_validate_json(Path(sys.argv[1]).read_text())
    compare(experiment, Path(sys.argv[2]), jobs=int(sys.argv[3]))
"""


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_killed_and_restarted_it_ends_the_same(
    jobs: int, small_dataset: PreparedDataset, tmp_path: Path
) -> None:
    settings = experiment(small_dataset)
    write(tmp_path / "experiment.json", settings.model_dump_json())
    script = write(tmp_path / "script.py", SCRIPT)
    command = [sys.executable, script, tmp_path / "experiment.json", tmp_path / "killed", str(jobs)]

    process = subprocess.Popen(command)
    deadline = time.monotonic() + 120
    while not list((tmp_path / "killed").rglob("checkpoint.pt")):
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    time.sleep(1.0)  # workers end with their parent
    assert len(outcome(tmp_path / "killed")) < 4, "killed too late to show anything"

    subprocess.run(command, check=True, timeout=300)
    compare(settings, tmp_path / "undisturbed")
    assert outcome(tmp_path / "killed") == outcome(tmp_path / "undisturbed")
    assert len(outcome(tmp_path / "killed")) == 4


def test_more_is_learned_in_every_fold_and_never_tested(
    small_dataset: PreparedDataset, more_dataset: PreparedDataset, tmp_path: Path
) -> None:
    plain = experiment(small_dataset, recipe_changes=CHANGES | {"epochs": 1})
    more = plain.model_copy(update={"extra_train_datasets": (str(more_dataset.folder),)})
    alone, both = (compare(each, tmp_path / name) for name, each in (("alone", plain), ("both", more)))
    for one, other in zip(alone, both, strict=True):
        assert other["train_samples"] == one["train_samples"] + len(more_dataset)
        assert (other["val_samples"], other["test_samples"]) == (one["val_samples"], one["test_samples"])
    for fold in (0, 1):
        tested = [
            read_csv(tmp_path / name / f"runs/pointnet2/fold{fold}/predictions.csv")
            for name in ("alone", "both")
        ]
        assert [row["sample_id"] for row in tested[0]] == [row["sample_id"] for row in tested[1]]
        assert tested[0] != tested[1]
    card = read_card(tmp_path / "both/runs/pointnet2/fold0/weights.safetensors")
    assert card.trained_on.endswith(f"fold 0, and {len(more_dataset)} samples besides")
    only_tested = {"start_from": str(tmp_path / "alone"), "recipe_changes": CHANGES | {"epochs": 0}}
    as_it_was = compare(more.model_copy(update=only_tested), tmp_path / "as-it-was")
    assert [each["train_samples"] for each in as_it_was] == [each["train_samples"] for each in alone]


def test_what_was_learned_besides_is_not_tested_later(
    small_dataset: PreparedDataset, scene_dataset: PreparedDataset, tmp_path: Path
) -> None:
    first = experiment(scene_dataset, heads=("door",), extra_train_datasets=(str(small_dataset.folder),))
    prepare_comparison(first, tmp_path / "first")
    with pytest.raises(RunError, match=r"has learned all of .*, which is tested here"):
        prepare_comparison(experiment(small_dataset, start_from=str(tmp_path / "first")), tmp_path / "after")


def test_what_is_tested_is_not_learned_besides(
    small_dataset: PreparedDataset, more_dataset: PreparedDataset, tmp_path: Path
) -> None:
    itself = experiment(small_dataset, extra_train_datasets=(str(small_dataset.folder),))
    with pytest.raises(ConfigError, match=f"{len(small_dataset)} samples of .* show scenes of .*, such as p"):
        compare(itself, tmp_path / "comparison")
    assert not (tmp_path / "comparison").exists()
    one_of_few_points = experiment(
        small_dataset, num_points=161, extra_train_datasets=(str(more_dataset.folder),)
    )
    with pytest.raises(ConfigError, match="holds 160 points a cloud, not 161"):
        compare(one_of_few_points, tmp_path / "comparison")
    thinned = tmp_path / "thinned"
    shutil.copytree(more_dataset.folder, thinned)
    more_dataset.description.model_copy(update={"thin": True}).save(thinned)
    with pytest.raises(ConfigError, match="one was prepared with --thin"):
        compare(experiment(small_dataset, extra_train_datasets=(str(thinned),)), tmp_path / "comparison")
    missing = experiment(small_dataset, extra_train_datasets=(str(tmp_path / "gone"),))
    with pytest.raises(DatasetError, match="no prepared data set here"):
        compare(missing, tmp_path / "comparison")
