# SPDX-License-Identifier: Apache-2.0
"""The folder of tables: complete, the same bytes each time, and the tables of folds and runs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pandas as pd

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.predictions import load_results
from doorstate.evaluation.run_tables import misclassified_table, runs_table
from doorstate.evaluation.score_tables import folds_table
from doorstate.evaluation.table import UNDEFINED
from doorstate.evaluation.tables import build_tables, save_tables
from tests.evaluation.conftest import MakeComparison


def test_every_table_is_written_the_same_twice(
    simulated: PreparedDataset, make_comparison: MakeComparison, tmp_path: Path
) -> None:
    results = load_results(make_comparison(simulated, {"dgcnn": {simulated.rows[5]["sample_id"]: "closed"}}))
    tables = build_tables(results)
    save_tables(tables, tmp_path / "one")
    save_tables(build_tables(results), tmp_path / "two")
    assert {path.name for path in (tmp_path / "one").iterdir()} == {f"{name}.csv" for name in tables}
    for name, table in tables.items():
        path = tmp_path / "one" / f"{name}.csv"
        assert path.read_bytes() == (tmp_path / "two" / path.name).read_bytes()
        assert all(len(row) == len(table.columns) for row in table.rows), name
        assert len(set(table.columns)) == len(table.columns), name
        assert len(pd.read_csv(path)) == len(table.rows), name
    summary = pd.read_csv(tmp_path / "one" / "summary.csv")
    assert summary["errors"].tolist() == [0, 1]


def test_names_of_samples_are_no_formulas(
    simulated: PreparedDataset, make_comparison: MakeComparison, tmp_path: Path
) -> None:
    name = simulated.rows[5]["sample_id"]
    results = load_results(make_comparison(simulated, {"dgcnn": {name: "closed"}}))
    changed = replace(
        results,
        predictions=results.predictions.replace({"sample_id": {name: "=1+1"}}),
        manifest=results.manifest.rename(index={name: "=1+1"}),
    )
    save_tables({"misclassified": misclassified_table(changed)}, tmp_path)
    assert pd.read_csv(tmp_path / "misclassified.csv")["sample_id"].tolist() == ["./=1+1"]


def test_folds_table_leaves_gaps(simulated: PreparedDataset, make_comparison: MakeComparison) -> None:
    results = load_results(make_comparison(simulated, networks=["pointnet"], missing=[("pointnet", 2)]))
    assert folds_table(results).rows == (
        ("pointnet", "1.0000", "1.0000", UNDEFINED, "1.0000", "1.0000", "1.0000", "0.0000"),
    )


def test_runs_table_leaves_gaps(simulated: PreparedDataset, make_comparison: MakeComparison) -> None:
    folder = make_comparison(simulated, missing=[("dgcnn", 4)])
    (folder / "runs" / "pointnet" / "fold0" / "metrics.json").unlink()
    rows = runs_table(load_results(folder)).rows
    assert len(rows) == 10
    assert rows[0] == ("pointnet", "done", "0", UNDEFINED, "24", UNDEFINED, UNDEFINED, "1.0000", UNDEFINED)
    assert rows[1] == ("pointnet", "done", "1", "84", "24", "2", "0.9000", "1.0000", "12")
    assert rows[-1] == ("dgcnn", "missing", "4", *[UNDEFINED] * 6)
