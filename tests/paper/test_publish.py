# SPDX-License-Identifier: Apache-2.0
"""Publishing takes the predictions of finished runs, and the tested rows of their data sets."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from pandas.testing import assert_frame_equal
from paper.publish import publish

from doorstate.dataset.roles import Role
from doorstate.dataset.splits import read_splits, write_splits
from doorstate.dataset.store import PreparedDataset, open_dataset
from doorstate.errors import RunError
from doorstate.evaluation.predictions import load_results
from doorstate.evaluation.study import load_study_results
from doorstate.training.comparison import compare
from doorstate.training.experiment import Experiment

RECIPE = {"epochs": 1, "batch_size": 8, "precision": "fp32", "coarse_to_fine": []}


def define(folders: Path, name: str, text: str) -> None:
    (folders / "experiments" / f"{name}.toml").write_text(text)


def train(dataset: PreparedDataset, folder: Path) -> None:
    """Train one fold that tests six samples."""
    tested = [row["sample_id"] for row in dataset.rows[3:9]]
    validated = [row["sample_id"] for row in dataset.rows[9:15]]
    roles: dict[str, Role] = {row["sample_id"]: "train" for row in dataset.rows}
    write_splits(
        folder / "splits.csv", [roles | dict.fromkeys(tested, "test") | dict.fromkeys(validated, "val")]
    )
    experiment = Experiment.model_validate(
        {
            "name": folder.name,
            "dataset": str(dataset.folder),
            "networks": ("pointnet",),
            "folds": 1,
            "num_points": 128,
            "recipe_changes": RECIPE,
        }
    )
    compare(experiment, folder)


def test_a_comparison_and_its_tested_rows(folders: Path, small_dataset: PreparedDataset) -> None:
    define(folders, "trial", f'dataset = "{small_dataset.folder}"\n')
    train(small_dataset, folders / "runs" / "trial")
    target = publish("trial")
    assert {path.name for path in target.iterdir()} == {
        "experiment.json",
        "metrics.json",
        "splits.csv.gz",
        "predictions.csv.gz",
    }
    published, run = load_results(target), load_results(folders / "runs" / "trial")
    assert_frame_equal(published.predictions, run.predictions)
    assert read_splits(target / "splits.csv.gz") == read_splits(folders / "runs" / "trial" / "splits.csv")
    rows = open_dataset(folders / "results" / "datasets" / small_dataset.folder.name)
    assert rows.sample_ids == small_dataset.sample_ids[3:9]
    np.testing.assert_array_equal(rows.cloud(0), small_dataset.cloud(3), "replayed")


def test_a_study(folders: Path, small_dataset: PreparedDataset) -> None:
    define(folders, "trial", f'dataset = "{small_dataset.folder}"\npoints = [128]\n')
    train(small_dataset, folders / "runs" / "trial" / "as-trained-128")
    study = load_study_results(publish("trial"))
    assert list(study.parts) == ["as-trained-128"]
    assert len(study.parts["as-trained-128"].tested_by("pointnet")) == 6


def test_nothing_is_published_of_runs_that_are_not_finished(
    folders: Path, small_dataset: PreparedDataset
) -> None:
    define(folders, "trial", f'dataset = "{small_dataset.folder}"\n')
    train(small_dataset, folders / "runs" / "trial")
    shutil.rmtree(folders / "runs" / "trial" / "runs")
    with pytest.raises(RunError):
        publish("trial")
    assert list((folders / "results").iterdir()) == []
