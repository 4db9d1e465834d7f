# SPDX-License-Identifier: Apache-2.0
"""Nothing tested was trained on: weights to start from, additional training data."""

from __future__ import annotations

import shutil
from contextlib import nullcontext
from pathlib import Path

import pytest

from doorstate.dataset.store import PreparedDataset
from doorstate.errors import ConfigError, DatasetError, RunError
from doorstate.training.comparison import compare, prepare_comparison
from tests.training.runs import small_experiment


def test_weights_trained_on_test_samples_are_refused(small_dataset: PreparedDataset, tmp_path: Path) -> None:
    prepare_comparison(small_experiment(small_dataset), tmp_path / "first")
    everything = small_experiment(small_dataset, protocol="all", folds=1)
    prepare_comparison(everything, tmp_path / "all")
    for name, is_refused in (("first", False), ("all", True)):
        again = small_experiment(small_dataset, start_from=str(tmp_path / name))
        with pytest.raises(RunError, match=r"all.*start_from") if is_refused else nullcontext():
            prepare_comparison(again, tmp_path / f"after-{name}")
    same_names = tmp_path / "of-another-seed"
    shutil.copytree(small_dataset.folder, same_names)
    elsewhere = {"start_from": str(tmp_path / "all"), "dataset": str(same_names)}
    prepare_comparison(small_experiment(small_dataset).model_copy(update=elsewhere), tmp_path / "elsewhere")


def test_additional_training_data_is_not_tested_later(
    small_dataset: PreparedDataset, scene_dataset: PreparedDataset, tmp_path: Path
) -> None:
    first = small_experiment(
        scene_dataset, heads=("door",), extra_train_datasets=(str(small_dataset.folder),)
    )
    prepare_comparison(first, tmp_path / "first")
    with pytest.raises(RunError, match="start_from"):
        prepare_comparison(
            small_experiment(small_dataset, start_from=str(tmp_path / "first")), tmp_path / "after"
        )


def test_additional_data_must_fit_and_show_other_scenes(
    small_dataset: PreparedDataset, more_dataset: PreparedDataset, tmp_path: Path
) -> None:
    itself = small_experiment(small_dataset, extra_train_datasets=(str(small_dataset.folder),))
    with pytest.raises(ConfigError, match=f"{len(small_dataset)} samples") as caught:
        compare(itself, tmp_path / "comparison")
    assert caught.value.field == "extra_train_datasets"
    assert not (tmp_path / "comparison").exists()
    too_many_points = small_experiment(
        small_dataset, num_points=161, extra_train_datasets=(str(more_dataset.folder),)
    )
    with pytest.raises(ConfigError, match="161"):
        compare(too_many_points, tmp_path / "comparison")
    thinned = tmp_path / "thinned"
    shutil.copytree(more_dataset.folder, thinned)
    more_dataset.description.model_copy(update={"thin": True}).save(thinned)
    with pytest.raises(ConfigError, match="thin"):
        compare(
            small_experiment(small_dataset, extra_train_datasets=(str(thinned),)), tmp_path / "comparison"
        )
    missing = small_experiment(small_dataset, extra_train_datasets=(str(tmp_path / "gone"),))
    with pytest.raises(DatasetError, match="gone"):
        compare(missing, tmp_path / "comparison")
