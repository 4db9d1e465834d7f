# SPDX-License-Identifier: Apache-2.0
"""A study is the same from its run folders and from its published form."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from pandas.testing import assert_frame_equal

from doorstate.dataset.store import PreparedDataset
from doorstate.errors import RunError
from doorstate.evaluation.study import load_study_results, save_study_results
from tests.evaluation.conftest import MakeComparison


@pytest.fixture
def folder(simulated: PreparedDataset, make_comparison: MakeComparison, tmp_path: Path) -> Path:
    """A study of two comparisons on one data set, the second of one network, and one latency."""
    study = tmp_path / "study"
    study.mkdir()
    make_comparison(simulated).rename(study / "many")
    wrong = {"pointnet": {simulated.rows[0]["sample_id"]: "open"}}
    (study / "few").mkdir()
    make_comparison(simulated, wrong, networks=["pointnet"]).rename(study / "few" / "angles")
    (study / "latency.csv").write_text("network,points,median_ms\npointnet,256,7.25\n")
    (tmp_path / "published" / "datasets").mkdir(parents=True)
    shutil.copytree(simulated.folder, tmp_path / "published" / "datasets" / simulated.folder.name)
    return study


def test_published_form_holds_the_same_and_is_deterministic(folder: Path, tmp_path: Path) -> None:
    study = load_study_results(folder)
    published = tmp_path / "published" / "study"
    save_study_results(study, published)
    assert {path.name for path in published.iterdir()} == {
        "experiment.json",
        "metrics.json",
        "splits.csv.gz",
        "predictions.csv.gz",
    }
    again = load_study_results(published)
    assert list(again.parts) == list(study.parts) == ["few/angles", "many"]
    assert again.latencies_ms == study.latencies_ms == {("pointnet", 256): 7.25}
    for name, results in study.parts.items():
        assert_frame_equal(results.predictions, again.parts[name].predictions, check_exact=True)
        assert results.config == again.parts[name].config
        assert results.splits == again.parts[name].splits
        assert [run.metrics for run in results.runs] == [run.metrics for run in again.parts[name].runs]
    assert len(again.parts["few/angles"].errors) == 1
    save_study_results(again, tmp_path / "again")
    for path in published.iterdir():
        assert path.read_bytes() == (tmp_path / "again" / path.name).read_bytes()


def test_comparisons_of_one_data_set_share_their_splits(folder: Path, tmp_path: Path) -> None:
    splits = folder / "few" / "angles" / "splits.csv"
    text = splits.read_text()
    splits.write_text(text.replace("val", "train", 1))
    with pytest.raises(RunError) as raised:
        save_study_results(load_study_results(folder), tmp_path / "published" / "study")
    assert raised.value.field == "dataset"


def test_a_study_that_has_not_begun_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError):
        load_study_results(tmp_path)


def test_a_damaged_study_is_refused(folder: Path, tmp_path: Path) -> None:
    published = tmp_path / "published" / "study"
    save_study_results(load_study_results(folder), published)
    document = json.loads((published / "metrics.json").read_text())
    del document["parts"]["many"]
    (published / "metrics.json").write_text(json.dumps(document))
    with pytest.raises(RunError) as raised:
        load_study_results(published)
    assert raised.value.path == published
