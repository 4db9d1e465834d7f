# SPDX-License-Identifier: Apache-2.0
"""The folder of tables: every format, the same bytes each time, and the tables of runs and errors."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.results import load_results
from doorstate.evaluation.table import UNDEFINED
from doorstate.evaluation.tables import misclassified_table, runs_table, write_tables


def test_every_table_in_every_format_and_the_same_twice(
    simulated: PreparedDataset, make_comparison: Callable[..., Path], tmp_path: Path
) -> None:
    results = load_results(make_comparison(simulated, {"dgcnn": {simulated.rows[5]["sample_id"]: "closed"}}))
    tables = write_tables(results, simulated, tmp_path / "one")
    write_tables(results, simulated, tmp_path / "two")
    expected = {f"{name}.{ending}" for name in tables for ending in ("md", "tex", "csv")}
    assert {path.name for path in (tmp_path / "one").iterdir()} == expected
    for name in expected:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    for name, table in tables.items():
        assert all(len(row) == len(table.columns) for row in table.rows), name
        assert len(set(table.columns)) == len(table.columns), name
        with (tmp_path / "one" / f"{name}.csv").open(encoding="utf-8", newline="") as file:
            assert len(list(csv.DictReader(file))) == len(table.rows)


def test_runs_table_shows_gaps(simulated: PreparedDataset, make_comparison: Callable[..., Path]) -> None:
    folder = make_comparison(simulated, missing=[("dgcnn", 4)])
    (folder / "runs" / "pointnet" / "fold0" / "metrics.json").unlink()
    rows = runs_table(load_results(folder)).rows
    assert len(rows) == 10
    assert rows[0] == ("pointnet", "done", "0", UNDEFINED, "24", UNDEFINED, UNDEFINED, "1.0000", UNDEFINED)
    assert rows[1] == ("pointnet", "done", "1", "84", "24", "2", "0.9000", "1.0000", "12")
    assert rows[-1] == ("dgcnn", "missing", "4", *[UNDEFINED] * 6)


def test_misclassified_table_carries_the_manifest(
    simulated: PreparedDataset, imported: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    row = simulated.rows[2]
    results = load_results(make_comparison(simulated, {"dgcnn": {row["sample_id"]: "semi_open"}}))
    table = misclassified_table(results, simulated)
    (cells,) = (dict(zip(table.columns, line, strict=True)) for line in table.rows)
    assert (cells["network"], cells["state"], cells["predicted"]) == ("dgcnn", "open", "semi_open")
    assert (cells["p_closed"], cells["p_semi_open"]) == ("0.1500", "0.7000")
    assert (cells["region"], cells["same_image_as"]) == (row["region"], "semi_open")
    results = load_results(make_comparison(imported, {"dgcnn": {"open/3": "closed"}}))
    (line,) = misclassified_table(results, imported).rows
    assert line[2:5] == ("open/3", "open", "closed")
    assert set(line[8:]) == {""}
