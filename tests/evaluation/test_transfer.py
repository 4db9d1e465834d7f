# SPDX-License-Identifier: Apache-2.0
"""Grid of a transfer study: every pair in its place, missing ones undefined."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from doorstate.dataset.store import PreparedDataset
from doorstate.errors import RunError
from doorstate.evaluation.figures.transfer import transfer_figure
from doorstate.evaluation.study import StudyResults, load_study_results
from doorstate.evaluation.table import UNDEFINED
from doorstate.evaluation.transfer import score_transfer, transfer_grid, transfer_table, write_transfer
from tests.evaluation.conftest import MakeComparison


@pytest.fixture
def scores() -> pd.DataFrame:
    frame = pd.DataFrame(
        [
            ("pointnet", "a", "x", 10, 0.9),
            ("pointnet", "a", "y", 20, 0.5),
            ("pointnet", "b", "y", 20, 0.25),
            ("dgcnn", "b", "x", 10, 1.0),
        ],
        columns=["method", "trained", "tested", "samples", "f1"],
    )
    orders = {"method": ["pointnet", "dgcnn"], "trained": ["a", "b"], "tested": ["x", "y"]}
    for name, order in orders.items():
        frame[name] = pd.Categorical(frame[name], order, ordered=True)
    return frame


def test_a_row_is_a_training_and_a_column_a_data_set(scores: pd.DataFrame) -> None:
    table = transfer_table(scores)
    assert table.columns[2:] == ("x", "y")
    assert table.rows == (
        ("pointnet", "a", "0.9000", "0.5000"),
        ("pointnet", "b", UNDEFINED, "0.2500"),
        ("dgcnn", "b", "1.0000", UNDEFINED),
    )


def test_figure_has_the_numbers_of_the_table(scores: pd.DataFrame) -> None:
    first, second = transfer_figure(transfer_grid(scores)).axes
    assert [text.get_text() for text in first.texts] == ["0.900", "0.500", UNDEFINED, "0.250"]
    assert [text.get_text() for text in second.texts] == ["1.000", UNDEFINED]
    assert [label.get_text() for label in second.get_yticklabels()] == ["b"]
    assert [label.get_text() for label in second.get_xticklabels()] == ["x", "y"]


def test_a_study_without_a_finished_part_is_refused() -> None:
    with pytest.raises(RunError):
        score_transfer(StudyResults({}), ("a",), ("x",))


def test_parts_of_a_study_are_scored(
    simulated: PreparedDataset, make_comparison: MakeComparison, tmp_path: Path
) -> None:
    wrong = {"pointnet": {simulated.rows[0]["sample_id"]: "open"}}
    (tmp_path / "s" / "a").mkdir(parents=True)
    make_comparison(simulated, wrong, ("pointnet",)).rename(tmp_path / "s" / "a" / "x")
    scores = score_transfer(load_study_results(tmp_path / "s"), ("a",), ("x", "y"))
    (row,) = scores.to_dict("records")
    assert (row["method"], row["trained"], row["tested"], row["samples"]) == ("pointnet", "a", "x", 120)
    assert row["f1"] == pytest.approx(1 - 1 / 120, abs=1e-4)
    assert transfer_grid(scores)["y"].isna().all()
    out = write_transfer(scores, tmp_path / "report")
    assert (out / "tables" / "transfer.csv").is_file()
    assert (out / "figures" / "transfer.png").is_file()
