# SPDX-License-Identifier: Apache-2.0
"""Comparison folders: whole, partial, and each way of not fitting together."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from doorstate.dataset.splits import read_splits
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import DoorstateError, RunError
from doorstate.evaluation.results import load_results


def _predictions(folder: Path, network: str = "pointnet", fold: int = 0) -> Path:
    return folder / "runs" / network / f"fold{fold}" / "predictions.csv"


def _edit(path: Path, change: Callable[[list[str]], list[str]]) -> None:
    path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")


def test_a_whole_comparison(simulated: PreparedDataset, make_comparison: Callable[..., Path]) -> None:
    wrong = {"dgcnn": {simulated.rows[0]["sample_id"]: "open"}}
    results = load_results(make_comparison(simulated, wrong))
    assert results.networks == ("pointnet", "dgcnn")
    assert results.missing == ()
    assert results.dataset_folder == simulated.folder
    pooled = results.pooled("dgcnn")
    assert sorted(pooled.sample_ids) == sorted(row["sample_id"] for row in simulated.rows)
    assert np.count_nonzero(~pooled.right) == 1
    assert pooled.probabilities.shape == (len(simulated.rows), 3)
    (error,) = results.error_rows
    assert (error.network, error.sample_id) == ("dgcnn", simulated.rows[0]["sample_id"])
    assert (error.state, error.predicted, error.confidence) == ("closed", "open", 0.7)
    fold = int(pooled.folds[pooled.sample_ids.index(error.sample_id)])
    assert error.fold == fold
    assert results.splits[fold][error.sample_id] == "test"
    assert sum(results.role_counts(0).values()) == len(simulated.rows)


def test_runs_keep_what_they_recorded(
    simulated: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    folder = make_comparison(simulated)
    for name in ("metrics.json", "log.csv", "environment.json"):
        (_predictions(folder).parent / name).unlink()
    bare, full = load_results(folder).runs[:2]
    assert (bare.log, bare.environment) == ({}, {})
    assert math.isnan(bare.metric("best_epoch"))
    assert full.metric("best_epoch") == 2
    assert full.log["val_loss"].tolist() == [1 / 2, 1 / 3, 1 / 4]
    assert full.environment["python"] == "3.11"


def test_missing_runs_are_listed(simulated: PreparedDataset, make_comparison: Callable[..., Path]) -> None:
    gone = (("pointnet", 3), *(("dgcnn", fold) for fold in range(5)))
    results = load_results(make_comparison(simulated, missing=gone))
    assert results.missing == gone
    assert results.networks == ("pointnet",)
    assert len(results.pooled("pointnet")) < len(simulated.rows)


def test_the_first_folds_alone(simulated: PreparedDataset, make_comparison: Callable[..., Path]) -> None:
    folder = make_comparison(simulated, missing=[("dgcnn", 2), ("pointnet", 4)])
    results = load_results(folder, folds=2)
    assert results.missing == ()
    assert {run.fold for run in results.runs} == {0, 1}
    assert load_results(folder, folds=9).missing == (("pointnet", 4), ("dgcnn", 2))


def test_a_data_set_beside_the_comparison_is_found(
    simulated: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    folder = make_comparison(simulated)
    (folder / "data").symlink_to(simulated.folder)
    document = json.loads((folder / "comparison.json").read_text()) | {"dataset": "data"}
    (folder / "comparison.json").write_text(json.dumps(document))
    assert load_results(folder).dataset_folder == folder / "data"


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
    "not tested here": (_of_another_fold, "no test sample of fold 0"),
    "too few": (lambda f: _edit(_predictions(f), lambda lines: lines[:-2]), "test samples of fold 0"),
    "no samples": (lambda f: _predictions(f).write_text("sample_id\n"), "0 of"),
    "other state": (
        lambda f: _edit(_predictions(f), lambda lines: [lines[0], _flip_state(lines[1]), *lines[2:]]),
        "manifest.csv",
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
def test_damage_is_told_in_one_line(
    kind: str, imported: PreparedDataset, make_comparison: Callable[..., Path]
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


def test_nothing_trained_yet(imported: PreparedDataset, make_comparison: Callable[..., Path]) -> None:
    gone = [(network, fold) for network in ("pointnet", "dgcnn") for fold in range(5)]
    with pytest.raises(RunError, match="no run has predictions yet"):
        load_results(make_comparison(imported, missing=gone))


def test_fewer_folds_than_the_splits_hold(
    imported: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    folder = make_comparison(imported)
    _change_comparison(folder, folds=2)
    results = load_results(folder)
    assert {run.fold for run in results.runs} == {0, 1}
    assert results.missing == ()
