# SPDX-License-Identifier: Apache-2.0
"""The matrix of a transfer study: every pair in its place, what is missing left out."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from doorstate.dataset.store import PreparedDataset
from doorstate.errors import RunError
from doorstate.evaluation.transfer import (
    TransferResults,
    load_transfer_results,
    transfer_figure,
    transfer_table,
)

from .conftest import MakeComparison

RESULTS = TransferResults(
    networks=("pointnet", "dgcnn"),
    trained=("a", "b"),
    tested=("x", "y"),
    macro_f1={
        ("pointnet", "a", "x"): 0.9,
        ("pointnet", "a", "y"): 0.5,
        ("pointnet", "b", "y"): 0.25,
        ("dgcnn", "b", "x"): 1.0,
    },
    samples={"x": 10, "y": 20},
)


def test_a_row_is_a_training_and_a_column_a_data_set() -> None:
    table = transfer_table(RESULTS)
    assert table.columns == ("network", "trained on", "x", "y")
    assert table.rows == (
        ("pointnet", "a", "0.9000", "0.5000"),
        ("pointnet", "b", "–", "0.2500"),
        ("dgcnn", "b", "1.0000", "–"),
    )
    assert "x 10, y 20" in table.note


def test_the_figure_says_what_the_table_says() -> None:
    first, second = transfer_figure(RESULTS).axes
    assert [text.get_text() for text in first.texts] == ["0.900", "0.500", "–", "0.250"]
    assert [text.get_text() for text in second.texts] == ["1.000", "–"]
    assert [label.get_text() for label in second.get_yticklabels()] == ["b"]
    assert [label.get_text() for label in second.get_xticklabels()] == ["x", "y"]


def test_an_empty_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="no finished part"):
        load_transfer_results(tmp_path, ("a",), ("x",))


def test_cells_are_read_with_the_data_sets_that_lie_beside_them(
    simulated: PreparedDataset, make_comparison: MakeComparison, tmp_path: Path
) -> None:
    wrong = {"pointnet": {simulated.rows[0]["sample_id"]: "open"}}
    folder = make_comparison(simulated, wrong, ("pointnet",))
    (tmp_path / "s" / "a").mkdir(parents=True)
    cell = folder.rename(tmp_path / "s" / "a" / "x")
    asked = json.loads((cell / "comparison.json").read_text())
    (cell / "comparison.json").write_text(json.dumps(asked | {"dataset": "gone/doors-160"}))
    with pytest.raises(RunError, match=r"no manifest\.csv"):
        load_transfer_results(tmp_path / "s", ("a",), ("x", "y"))
    (tmp_path / "published").mkdir()
    (tmp_path / "published" / "doors-160").symlink_to(simulated.folder)
    found = load_transfer_results(tmp_path / "s", ("a",), ("x", "y"), tmp_path / "published")
    assert found.samples == {"x": len(simulated)}
    assert found.macro_f1["pointnet", "a", "x"] == pytest.approx(1 - 1 / len(simulated), abs=1e-4)
    assert found.trainings("pointnet") == ("a",)
