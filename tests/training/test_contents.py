# SPDX-License-Identifier: Apache-2.0
"""Runs end with the data, splits and weights that they began with."""

from __future__ import annotations

import gzip
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from doorstate.dataset.digests import dataset_digests
from doorstate.dataset.roles import Role
from doorstate.dataset.store import CLOUDS_FILE, PreparedDataset, open_dataset
from doorstate.errors import RunError
from doorstate.evaluation.predictions import load_results
from doorstate.simulation.manifest import MANIFEST_FILE
from doorstate.training.comparison import compare
from doorstate.training.contents import DIGESTS
from doorstate.training.rule_run import RuleRunConfig, run_rule
from doorstate.training.run_folder import run_of
from tests.training.runs import CHANGES, small_experiment

METHODS = {"networks": ("pointnet",), "folds": 2, "recipe_changes": CHANGES | {"epochs": 1}}


@pytest.fixture
def data(small_dataset: PreparedDataset, tmp_path: Path) -> PreparedDataset:
    shutil.copytree(small_dataset.folder, tmp_path / "data")
    return open_dataset(tmp_path / "data")


def change_clouds(folder: Path) -> None:
    clouds = np.load(folder / CLOUDS_FILE)
    clouds[0, 0, 0] += 0.5
    # Another file under the old name, as after a second `prepare`; the old one may be mapped.
    np.save(folder / "new.npy", clouds)
    (folder / "new.npy").replace(folder / CLOUDS_FILE)


def change_manifest(folder: Path) -> None:
    text = (folder / MANIFEST_FILE).read_text()
    (folder / MANIFEST_FILE).unlink()
    (folder / MANIFEST_FILE).write_text(text.replace("xtion", "xtion2") + "\n")


@pytest.mark.parametrize("change", [change_clouds, change_manifest])
def test_data_that_was_swapped_under_half_a_comparison_is_refused(
    change: Callable[[Path], None], data: PreparedDataset, tmp_path: Path
) -> None:
    experiment = small_experiment(data, **METHODS)

    def stop_after_one(done: int, total: int) -> None:
        if done == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        compare(experiment, tmp_path / "c", progress=stop_after_one)
    shutil.copytree(data.folder, tmp_path / "good")
    change(data.folder)
    name = CLOUDS_FILE if change is change_clouds else MANIFEST_FILE
    for use in (lambda: compare(experiment, tmp_path / "c"), lambda: load_results(tmp_path / "c")):
        with pytest.raises(RunError, match=name) as refused:
            use()
        assert refused.value.path == tmp_path / "c"
        assert refused.value.field == name
    # Moved data are the same data, and a manifest alone is enough for a report.
    (tmp_path / "good" / CLOUDS_FILE).unlink()
    assert load_results(tmp_path / "c", tmp_path / "good").missing == (("pointnet", 1),)
    (tmp_path / "c" / DIGESTS).unlink()
    with pytest.raises(RunError) as refused_run:
        load_results(tmp_path / "c")
    assert refused_run.value.path == run_of(tmp_path / "c", "pointnet", 0).path


def test_splits_that_were_edited_are_refused(data: PreparedDataset, tmp_path: Path) -> None:
    experiment = small_experiment(data, **METHODS)
    compare(experiment, tmp_path / "c")
    path = tmp_path / "c" / "splits.csv"
    path.write_text(path.read_text().replace("test", "train", 1))
    with pytest.raises(RunError) as refused:
        compare(experiment, tmp_path / "c")
    assert refused.value.field is not None
    assert refused.value.field.startswith("splits")


def test_folders_without_digests_are_continued_and_reported(data: PreparedDataset, tmp_path: Path) -> None:
    experiment = small_experiment(data, **METHODS)
    compare(experiment, tmp_path / "c")
    for path in (tmp_path / "c").rglob(DIGESTS):
        path.unlink()
    assert load_results(tmp_path / "c").missing == ()
    compare(experiment, tmp_path / "c")
    assert json.loads((tmp_path / "c" / DIGESTS).read_text()).keys() >= {
        MANIFEST_FILE,
        CLOUDS_FILE,
        "splits 4",
    }


def test_data_that_change_during_a_run_are_refused_at_its_end(
    data: PreparedDataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = RuleRunConfig(
        rule="plane_state", parameters={}, dataset=str(data.folder), protocol="paper", fold=0
    )
    roles: dict[str, Role] = dict.fromkeys(data.sample_ids[:2], "test")
    raw_cloud = PreparedDataset.raw_cloud

    def change_and_return(dataset: PreparedDataset, index: int) -> np.ndarray:
        if index == 1:
            change_clouds(data.folder)
        return raw_cloud(dataset, index)

    monkeypatch.setattr(PreparedDataset, "raw_cloud", change_and_return)
    with pytest.raises(RunError):
        run_rule(config, data, roles, tmp_path / "run")
    assert not (tmp_path / "run" / "metrics.json").exists()


def test_a_compressed_manifest_has_the_digest_of_its_text(data: PreparedDataset) -> None:
    before = dataset_digests(data.folder)
    text = (data.folder / MANIFEST_FILE).read_bytes()
    (data.folder / MANIFEST_FILE).unlink()
    (data.folder / f"{MANIFEST_FILE}.gz").write_bytes(gzip.compress(text))
    assert dataset_digests(data.folder) == before
