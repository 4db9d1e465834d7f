# SPDX-License-Identifier: Apache-2.0
"""Loading results: whole, partial and damaged folders, the published form, and several comparisons joined."""

from __future__ import annotations

import gzip
import json
import math
import os
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
from pandas.testing import assert_frame_equal

from doorstate.dataset.splits import read_splits
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import DoorstateError, RunError
from doorstate.evaluation.predictions import has_results, load_results, save_results
from tests.evaluation.conftest import MakeComparison


def _predictions(folder: Path, network: str = "pointnet", fold: int = 0) -> Path:
    return folder / "runs" / network / f"fold{fold}" / "predictions.csv"


def _edit(path: Path, change: Callable[[list[str]], list[str]]) -> None:
    path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")


def test_whole_comparison(simulated: PreparedDataset, make_comparison: MakeComparison) -> None:
    wrong = {"dgcnn": {simulated.rows[0]["sample_id"]: "open"}}
    results = load_results(make_comparison(simulated, wrong))
    assert results.methods == results.networks == ("pointnet", "dgcnn")
    assert results.missing == ()
    assert results.dataset_folder == simulated.folder
    tested = results.tested_by("dgcnn")
    assert sorted(tested["sample_id"]) == sorted(row["sample_id"] for row in simulated.rows)
    assert tested["correct"].sum() == len(simulated.rows) - 1
    (error,) = results.errors.to_dict("records")
    assert (error["method"], error["sample_id"]) == ("dgcnn", simulated.rows[0]["sample_id"])
    assert (error["state"], error["predicted"], error["confidence"]) == ("closed", "open", 0.7)
    assert results.splits[error["fold"]][error["sample_id"]] == "test"
    assert sum(results.role_counts(0).values()) == len(simulated.rows)


def test_predictions_are_joined_with_the_manifest(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    folder = make_comparison(simulated)
    path = _predictions(folder)
    _edit(path, lambda lines: [f"{lines[0]},opening_angle_deg", *(f"{line},12.5" for line in lines[1:])])
    frame = load_results(folder).joined
    row = frame[(frame["method"] == "pointnet") & (frame["fold"] == 0)].iloc[0]
    manifest = simulated.rows[simulated.index_of(row["sample_id"])]
    assert row["opening_angle_deg_predicted"] == 12.5
    assert row["opening_angle_deg"] == float(manifest["opening_angle_deg"])
    assert row["region"] == manifest["region"]
    assert len(frame) == 2 * len(simulated.rows)


def test_runs_keep_what_they_recorded(simulated: PreparedDataset, make_comparison: MakeComparison) -> None:
    folder = make_comparison(simulated)
    for name in ("metrics.json", "log.csv", "environment.json"):
        (_predictions(folder).parent / name).unlink()
    bare, full = load_results(folder).runs[:2]
    assert bare.log.empty
    assert bare.environment == {}
    assert math.isnan(bare.metric("best_epoch"))
    assert full.metric("best_epoch") == 2
    assert full.log["val_loss"].tolist() == [1 / 2, 1 / 3, 1 / 4]
    assert full.environment["python"] == "3.11"


def test_missing_runs_are_listed(simulated: PreparedDataset, make_comparison: MakeComparison) -> None:
    missing = (("pointnet", 3), *(("dgcnn", fold) for fold in range(5)))
    results = load_results(make_comparison(simulated, missing=missing))
    assert results.missing == missing
    assert results.methods == ("pointnet",)
    assert len(results.tested_by("pointnet")) < len(simulated.rows)


def test_first_folds_only(simulated: PreparedDataset, make_comparison: MakeComparison) -> None:
    folder = make_comparison(simulated, missing=[("dgcnn", 2), ("pointnet", 4)])
    results = load_results(folder, folds=2)
    assert results.missing == ()
    assert {run.fold for run in results.runs} == set(results.predictions["fold"]) == {0, 1}
    assert load_results(folder, folds=9).missing == (("pointnet", 4), ("dgcnn", 2))


def test_dataset_beside_the_comparison(simulated: PreparedDataset, make_comparison: MakeComparison) -> None:
    folder = make_comparison(simulated)
    (folder / "data").symlink_to(simulated.folder)
    _change_comparison(folder, dataset="data")
    assert load_results(folder).dataset_folder == folder / "data"


def test_head_outputs_add_columns_and_samples_without_a_door(
    with_empty_scenes: PreparedDataset, make_comparison: MakeComparison
) -> None:
    folder = make_comparison(with_empty_scenes)
    path = _predictions(folder, "dgcnn").with_name("head_outputs.csv")
    tested = [name for name, role in read_splits(folder / "splits.csv")[0].items() if role == "test"]
    path.write_text("".join(["sample_id,p_door\n", *(f"{name},0.25\n" for name in tested)]))
    results = load_results(folder)
    rows = results.joined[(results.joined["method"] == "dgcnn") & (results.joined["fold"] == 0)]
    assert (rows["p_door"] == 0.25).all()
    without = rows[rows["state"] == "no_door"]
    assert len(without) == 4
    assert without["predicted"].isna().all()
    assert not set(without.index) & set(results.tested.index)


def test_published_form_holds_the_same_and_is_deterministic(
    simulated: PreparedDataset, make_comparison: MakeComparison, tmp_path: Path
) -> None:
    results = load_results(make_comparison(simulated, {"dgcnn": {simulated.rows[0]["sample_id"]: "open"}}))
    published = tmp_path / "results" / "trial"
    save_results(results, published)
    names = ["experiment.json", "metrics.json", "predictions.csv.gz", "splits.csv.gz"]
    assert sorted(path.name for path in published.iterdir()) == names
    assert has_results(published)
    loaded = load_results(published)
    assert_frame_equal(loaded.predictions, results.predictions, check_exact=True)
    assert loaded.config == results.config
    assert loaded.splits == results.splits
    for one, two in zip(loaded.runs, results.runs, strict=True):
        assert (one.method, one.fold, one.metrics) == (two.method, two.fold, two.metrics)
        assert_frame_equal(one.log, two.log)
    save_results(loaded, tmp_path / "again")
    for name in names:
        assert (tmp_path / "again" / name).read_bytes() == (published / name).read_bytes()


def test_published_manifest_is_found_beside_the_comparison(
    simulated: PreparedDataset, make_comparison: MakeComparison, tmp_path: Path
) -> None:
    folder = tmp_path / "results" / "trial"
    save_results(load_results(make_comparison(simulated)), folder)
    manifest = tmp_path / "results" / "datasets" / simulated.folder.name / "manifest.csv.gz"
    manifest.parent.mkdir(parents=True)
    manifest.write_bytes(gzip.compress((simulated.folder / "manifest.csv").read_bytes()))
    assert load_results(folder).dataset_folder == manifest.parent


def _of_another_fold(folder: Path) -> None:
    roles = read_splits(folder / "splits.csv")[0]
    trained = next(sample_id for sample_id, role in roles.items() if role == "train")
    _edit(_predictions(folder), lambda lines: [*lines[:-1], f"{trained},{lines[-1].split(',', 1)[1]}"])


def _change_comparison(folder: Path, **changes: object) -> None:
    document = json.loads((folder / "comparison.json").read_text()) | changes
    (folder / "comparison.json").write_text(json.dumps(document))


def _flip_state(line: str) -> str:
    sample_id, state, rest = line.split(",", 2)
    return f"{sample_id},{'open' if state == 'closed' else 'closed'},{rest}"


DAMAGE: dict[str, tuple[Callable[[Path], object], str]] = {
    "no comparison": (lambda f: (f / "comparison.json").unlink(), "comparison.json"),
    "broken comparison": (lambda f: (f / "comparison.json").write_text("{"), "comparison.json"),
    "no list": (lambda f: (f / "comparison.json").write_text("[]"), "comparison.json"),
    "a word for a number": (lambda f: _change_comparison(f, folds="many"), "folds"),
    "more folds than splits": (lambda f: _change_comparison(f, folds=6), "splits.csv"),
    "data set gone": (lambda f: _change_comparison(f, dataset="/nowhere"), "/nowhere"),
    "no splits": (lambda f: (f / "splits.csv").unlink(), "splits.csv"),
    "tested twice": (
        lambda f: _edit(_predictions(f), lambda lines: [*lines[:-1], lines[1]]),
        "already tested in fold 0",
    ),
    "not tested here": (_of_another_fold, "sample of fold 0"),
    "too few": (lambda f: _edit(_predictions(f), lambda lines: lines[:-2]), "test samples of fold 0"),
    "no samples": (lambda f: _predictions(f).write_text("sample_id\n"), "0 of"),
    "other state": (
        lambda f: _edit(_predictions(f), lambda lines: [lines[0], _flip_state(lines[1]), *lines[2:]]),
        "state",
    ),
    "unknown state": (
        lambda f: _edit(_predictions(f), lambda lines: [*lines[:-1], lines[-1].replace("open", "ajar")]),
        "'ajar'",
    ),
    "no number": (
        lambda f: _edit(_predictions(f), lambda lines: [*lines[:-1], lines[-1].replace("0.7", "high")]),
        "high",
    ),
    "not finite": (
        lambda f: _edit(_predictions(f), lambda lines: [*lines[:-1], lines[-1].replace("0.7", "nan")]),
        "not finite",
    ),
    "column missing": (
        lambda f: _edit(_predictions(f), lambda lines: [lines[0].replace("p_open", "p"), *lines[1:]]),
        "p_open",
    ),
    "not text": (lambda f: _predictions(f).write_bytes(b"\xff\xfe\x00"), "predictions.csv"),
    "broken log": (lambda f: (_predictions(f).parent / "log.csv").write_text("epoch\none\n"), "log.csv"),
    "broken metrics": (lambda f: (_predictions(f).parent / "metrics.json").write_text("3"), "metrics.json"),
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_damage_is_an_error_of_one_line(
    kind: str, imported: PreparedDataset, make_comparison: MakeComparison
) -> None:
    folder = make_comparison(imported)
    damage, expected = DAMAGE[kind]
    if kind in ("unknown state", "no number", "not finite"):  # the last line must hold what is replaced
        _edit(_predictions(folder), lambda lines: [lines[0], *sorted(lines[1:], key=lambda k: ",open," in k)])
    damage(folder)
    with pytest.raises(DoorstateError) as caught:
        load_results(folder)
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["predictions.csv.gz", "splits.csv.gz", "metrics.json", "experiment.json"])
def test_damaged_published_form(
    name: str, imported: PreparedDataset, make_comparison: MakeComparison, tmp_path: Path
) -> None:
    folder = tmp_path / "published"
    save_results(load_results(make_comparison(imported)), folder)
    (folder / name).write_bytes((folder / name).read_bytes()[:40])
    with pytest.raises(DoorstateError, match=name):
        load_results(folder)


def test_a_pipe_or_a_huge_table_as_published_predictions_is_refused(
    imported: PreparedDataset,
    make_comparison: MakeComparison,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folder = tmp_path / "published"
    save_results(load_results(make_comparison(imported)), folder)
    path = folder / "predictions.csv.gz"
    monkeypatch.setattr("doorstate._files.MAX_TABLE_BYTES", 10 * path.stat().st_size)
    path.write_bytes(gzip.compress(b"method,fold\n" + b" " * 50 * path.stat().st_size))
    with pytest.raises(RunError, match=path.name):
        load_results(folder)
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(RunError, match=path.name):
        load_results(folder)


def test_nothing_trained_yet(imported: PreparedDataset, make_comparison: MakeComparison) -> None:
    missing = [(network, fold) for network in ("pointnet", "dgcnn") for fold in range(5)]
    with pytest.raises(RunError):
        load_results(make_comparison(imported, missing=missing))


def test_predictions_have_one_row_for_each_method_fold_role_and_sample(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    predictions = load_results(make_comparison(simulated)).predictions
    assert not predictions.duplicated(["method", "fold", "role", "sample_id"]).any()
    assert predictions.dtypes[["p_closed", "opening_angle_deg"]].eq("float64").all()
    assert isinstance(predictions["reason"].dtype, pd.StringDtype)
