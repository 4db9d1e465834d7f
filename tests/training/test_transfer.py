# SPDX-License-Identifier: Apache-2.0
"""A transfer study tests finished weights on what none of them has seen."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from doorstate._files import read_csv, write_csv
from doorstate.dataset.join import join_datasets
from doorstate.dataset.splits import draw_splits, read_splits, write_splits
from doorstate.dataset.store import MANIFEST, PreparedDataset
from doorstate.errors import ConfigError, RunError
from doorstate.training.comparison import Experiment, compare, prepare_comparison
from doorstate.training.run_folder import read_json
from doorstate.training.transfer import TransferStudy, load_transfer

CHANGES = {"epochs": 1, "batch_size": 8}


def trained(folder: Path, dataset: PreparedDataset, **changes: object) -> Path:
    """A comparison with its splits, of which nothing has been run."""
    values = {"name": "t", "dataset": str(dataset.folder), "networks": ("pointnet",), "num_points": 128}
    prepare_comparison(Experiment.model_validate(values | {"recipe_changes": CHANGES} | changes), folder)
    return folder


def study(**values: object) -> TransferStudy:
    return TransferStudy.model_validate({"name": "s", "networks": ("pointnet",), "num_points": 128} | values)


def test_a_set_that_was_trained_on_is_tested_where_it_was_not(
    small_dataset: PreparedDataset, scene_dataset: PreparedDataset, tmp_path: Path
) -> None:
    one = trained(tmp_path / "one", small_dataset)
    other = trained(tmp_path / "other", scene_dataset, protocol="by-scene", heads=("door",))
    tested = {"same": str(small_dataset.folder), "scenes": str(scene_dataset.folder)}
    found = study(trained={"one": str(one), "other": str(other)}, tested=tested)
    found.write_splits(tmp_path / "s")
    for name, comparison, dataset in (("same", one, small_dataset), ("scenes", other, scene_dataset)):
        (roles,) = read_splits(tmp_path / "s" / "one" / name / "splits.csv")
        assert [roles] == read_splits(tmp_path / "s" / "other" / name / "splits.csv"), (
            "the same for all weights"
        )
        before = read_splits(comparison / "splits.csv")[0]
        assert {role for sample, role in before.items() if roles[sample] == "test"} == {"test"}
        assert {role for sample, role in before.items() if roles[sample] == "unused"} == {"train", "val"}
        assert len(roles) == len(dataset)
    assert {cell.trained: cell.experiment.heads for cell in found.cells()} == {"one": (), "other": ("door",)}


def test_a_scene_is_known_whatever_sensor_saw_it(scene_dataset: PreparedDataset, tmp_path: Path) -> None:
    comparison = trained(tmp_path / "one", scene_dataset, protocol="by-scene", heads=("door",))
    noisy = tmp_path / "noisy"
    shutil.copytree(scene_dataset.folder, noisy)
    rows = read_csv(noisy / MANIFEST)
    write_csv(noisy / MANIFEST, [row | {"sample_id": row["sample_id"] + "-noisy"} for row in rows])
    study(trained={"one": str(comparison)}, tested={"noisy": str(noisy)}).write_splits(tmp_path / "s")
    (roles,) = read_splits(tmp_path / "s" / "one" / "noisy" / "splits.csv")
    before = read_splits(comparison / "splits.csv")[0]
    tested = {sample for sample, role in before.items() if role == "test"}
    assert {sample for sample, role in roles.items() if role == "test"} == {
        f"{name}-noisy" for name in tested
    }


def test_what_was_learned_besides_is_known(
    small_dataset: PreparedDataset,
    scene_dataset: PreparedDataset,
    more_dataset: PreparedDataset,
    tmp_path: Path,
) -> None:
    comparison = trained(tmp_path / "one", small_dataset, extra_train_datasets=(str(more_dataset.folder),))
    joined = join_datasets([scene_dataset.folder, more_dataset.folder], tmp_path / "joined").folder
    study(trained={"one": str(comparison)}, tested={"joined": str(joined)}).write_splits(tmp_path / "s")
    (roles,) = read_splits(tmp_path / "s" / "one" / "joined" / "splits.csv")
    assert {sample for sample, role in roles.items() if role == "unused"} == set(more_dataset.sample_ids)


def test_weights_are_tested_as_they_are(
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
    found = study(
        trained={"one": str(tmp_path / "one")},
        tested={"same": str(small_dataset.folder), "scenes": str(scene_dataset.folder)},
    )
    found.write_splits(tmp_path / "s")
    for cell in found.cells():
        if cell.tested == "same":
            compare(cell.experiment, tmp_path / "s" / cell.folder)
    first, again = (
        tmp_path.joinpath(*name, "runs", "pointnet", "fold0") for name in (("one",), ("s", "one", "same"))
    )
    assert (first / "predictions.csv").read_bytes() == (again / "predictions.csv").read_bytes()
    assert read_json(again / "metrics.json")["train_samples"] == 0


def test_a_comparison_is_asked_for_the_networks_that_it_has(
    small_dataset: PreparedDataset, tmp_path: Path
) -> None:
    data = str(small_dataset.folder)
    one = trained(tmp_path / "one", small_dataset)
    both = trained(tmp_path / "both", small_dataset, networks=("dgcnn", "pointnet"))
    names = {"one": str(one), "both": str(both)}
    found = study(trained=names, tested={"x": data}, networks=("pointnet", "dgcnn"))
    assert [cell.experiment.networks for cell in found.cells()] == [("pointnet",), ("pointnet", "dgcnn")]
    with pytest.raises(ConfigError, match="one: has no dgcnn"):
        list(study(trained=names, tested={"x": data}, networks=("dgcnn",)).cells())


def test_what_leaves_nothing_to_test_is_refused(small_dataset: PreparedDataset, tmp_path: Path) -> None:
    data = str(small_dataset.folder)
    everything = trained(tmp_path / "all", small_dataset, protocol="all", folds=1)
    with pytest.raises(ConfigError, match="every sample was trained on"):
        study(trained={"all": str(everything)}, tested={"same": data}).write_splits(tmp_path / "s")
    one = trained(tmp_path / "one", small_dataset)
    write_splits(tmp_path / "s" / "one" / "same" / "splits.csv", draw_splits(small_dataset.rows, "unseen", 0))
    with pytest.raises(RunError, match="tests other samples"):
        study(trained={"one": str(one)}, tested={"same": data}).write_splits(tmp_path / "s")
    with pytest.raises(RunError, match="no such comparison"):
        list(study(trained={"gone": str(tmp_path / "gone")}, tested={"same": data}).cells())


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("trained = ", "cannot be read as a study"),
        ("[trained]\na = 'x'\n", "tested: Field required"),
        ("[trained]\n'A b' = 'x'\n[tested]\na = 'y'\n", "trained"),
        ("epochs = 3\n[trained]\na = 'x'\n[tested]\na = 'y'\n", "epochs: Extra inputs"),
    ],
)
def test_a_wrong_study_is_one_line(text: str, complaint: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=complaint) as caught:
        load_transfer(path)
    assert "\n" not in str(caught.value)
