# SPDX-License-Identifier: Apache-2.0
"""Transfer studies: unseen samples, networks with weights, refused studies."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from doorstate._documents import read_json
from doorstate._files import read_csv, write_csv
from doorstate.dataset.join import join_datasets
from doorstate.dataset.splits import draw_splits, read_splits, write_splits
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import ConfigError, RunError
from doorstate.simulation.manifest import MANIFEST_FILE
from doorstate.training.comparison import compare, prepare_comparison
from doorstate.training.experiment import Experiment
from doorstate.training.study import load_study
from doorstate.training.transfer import TransferStudy

CHANGES = {"epochs": 1, "batch_size": 8}


def prepared(folder: Path, dataset: PreparedDataset, **changes: object) -> Path:
    """Return the folder of a comparison with its splits, of which nothing has been run."""
    values = {"name": "t", "dataset": str(dataset.folder), "networks": ("pointnet",), "num_points": 128}
    prepare_comparison(Experiment.model_validate(values | {"recipe_changes": CHANGES} | changes), folder)
    return folder


def study(**values: object) -> TransferStudy:
    return TransferStudy.model_validate({"name": "s", "networks": ("pointnet",), "num_points": 128} | values)


def test_unseen_samples_of_every_data_set_are_tested(
    small_dataset: PreparedDataset, scene_dataset: PreparedDataset, tmp_path: Path
) -> None:
    first = prepared(tmp_path / "first", small_dataset)
    second = prepared(tmp_path / "second", scene_dataset, protocol="by-scene", heads=("door",))
    tested = {"same": str(small_dataset.folder), "scenes": str(scene_dataset.folder)}
    transfer = study(trained={"first": str(first), "second": str(second)}, tested=tested)
    transfer.prepare(tmp_path / "s")
    for name, comparison, dataset in (("same", first, small_dataset), ("scenes", second, scene_dataset)):
        (roles,) = read_splits(tmp_path / "s" / "first" / name / "splits.csv")
        assert [roles] == read_splits(tmp_path / "s" / "second" / name / "splits.csv"), "same for all weights"
        before = read_splits(comparison / "splits.csv")[0]
        assert {role for sample, role in before.items() if roles[sample] == "test"} == {"test"}
        assert {role for sample, role in before.items() if roles[sample] == "unused"} == {"train", "val"}
        assert len(roles) == len(dataset)
    heads = {part.folder.parts[0]: part.experiment.heads for part in transfer.parts()}
    assert heads == {"first": (), "second": ("door",)}


def test_scene_is_seen_regardless_of_the_sensor(scene_dataset: PreparedDataset, tmp_path: Path) -> None:
    comparison = prepared(tmp_path / "one", scene_dataset, protocol="by-scene", heads=("door",))
    noisy = tmp_path / "noisy"
    shutil.copytree(scene_dataset.folder, noisy)
    rows = read_csv(noisy / MANIFEST_FILE)
    write_csv(noisy / MANIFEST_FILE, [row | {"sample_id": row["sample_id"] + "-noisy"} for row in rows])
    study(trained={"one": str(comparison)}, tested={"noisy": str(noisy)}).prepare(tmp_path / "s")
    (roles,) = read_splits(tmp_path / "s" / "one" / "noisy" / "splits.csv")
    before = read_splits(comparison / "splits.csv")[0]
    tested = {sample for sample, role in before.items() if role == "test"}
    assert {sample for sample, role in roles.items() if role == "test"} == {
        f"{name}-noisy" for name in tested
    }


def test_additional_training_samples_count_as_seen(
    small_dataset: PreparedDataset,
    scene_dataset: PreparedDataset,
    more_dataset: PreparedDataset,
    tmp_path: Path,
) -> None:
    comparison = prepared(tmp_path / "one", small_dataset, extra_train_datasets=(str(more_dataset.folder),))
    joined = join_datasets([scene_dataset.folder, more_dataset.folder], tmp_path / "joined").folder
    study(trained={"one": str(comparison)}, tested={"joined": str(joined)}).prepare(tmp_path / "s")
    (roles,) = read_splits(tmp_path / "s" / "one" / "joined" / "splits.csv")
    assert {sample for sample, role in roles.items() if role == "unused"} == set(more_dataset.sample_ids)


def test_weights_are_tested_unchanged(
    small_dataset: PreparedDataset, scene_dataset: PreparedDataset, tmp_path: Path
) -> None:
    values = {
        "name": "t",
        "networks": ("pointnet",),
        "num_points": 128,
        "folds": 1,
        "recipe_changes": CHANGES,
    }
    compare(Experiment.model_validate(values | {"dataset": str(small_dataset.folder)}), tmp_path / "one")
    transfer = study(
        trained={"one": str(tmp_path / "one")},
        tested={"same": str(small_dataset.folder), "scenes": str(scene_dataset.folder)},
    )
    transfer.prepare(tmp_path / "s")
    for part in transfer.parts():
        if part.folder.name == "same":
            compare(part.experiment, tmp_path / "s" / part.folder)
    first, again = (
        tmp_path.joinpath(*name, "runs", "pointnet", "fold0") for name in (("one",), ("s", "one", "same"))
    )
    assert (first / "predictions.csv").read_bytes() == (again / "predictions.csv").read_bytes()
    assert read_json(again / "metrics.json")["train_samples"] == 0


def test_only_networks_with_weights_are_tested(small_dataset: PreparedDataset, tmp_path: Path) -> None:
    data = str(small_dataset.folder)
    one = prepared(tmp_path / "one", small_dataset)
    both = prepared(tmp_path / "both", small_dataset, networks=("dgcnn", "pointnet"))
    names = {"one": str(one), "both": str(both)}
    transfer = study(trained=names, tested={"x": data}, networks=("pointnet", "dgcnn"))
    assert [part.experiment.networks for part in transfer.parts()] == [("pointnet",), ("pointnet", "dgcnn")]
    with pytest.raises(ConfigError, match="dgcnn") as caught:
        list(study(trained=names, tested={"x": data}, networks=("dgcnn",)).parts())
    assert caught.value.path == str(one)


def test_study_without_unseen_samples_is_refused(small_dataset: PreparedDataset, tmp_path: Path) -> None:
    data = str(small_dataset.folder)
    everything = prepared(tmp_path / "all", small_dataset, protocol="all", folds=1)
    with pytest.raises(ConfigError, match="every sample"):
        study(trained={"all": str(everything)}, tested={"same": data}).prepare(tmp_path / "s")
    one = prepared(tmp_path / "one", small_dataset)
    write_splits(tmp_path / "s" / "one" / "same" / "splits.csv", draw_splits(small_dataset.rows, "unseen", 0))
    with pytest.raises(RunError, match="tests other samples"):
        study(trained={"one": str(one)}, tested={"same": data}).prepare(tmp_path / "s")
    with pytest.raises(RunError) as caught:
        list(study(trained={"gone": str(tmp_path / "gone")}, tested={"same": data}).parts())
    assert caught.value.path == tmp_path / "gone"


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ("trained = ", "TOML"),
        ("[trained]\na = 'x'\n", "tested"),
        ("[trained]\n'A b' = 'x'\n[tested]\na = 'y'\n", "trained"),
        ("epochs = 3\n[trained]\na = 'x'\n[tested]\na = 'y'\n", "epochs"),
    ],
)
def test_wrong_study_is_refused_in_one_line(text: str, field: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=field) as caught:
        load_study(path, TransferStudy)
    assert "\n" not in str(caught.value)
