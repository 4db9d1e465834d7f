# SPDX-License-Identifier: Apache-2.0
"""Tables by network against scikit-learn and hand-counted cases."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from sklearn.metrics import classification_report, f1_score

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.results import ComparisonResults, load_results
from doorstate.evaluation.score_tables import (
    confusion_table,
    fold_f1,
    folds_table,
    paired_table,
    scores_table,
    summary_table,
)
from doorstate.evaluation.table import UNDEFINED, number
from doorstate.types import ABSTAINED, STATES


@pytest.fixture
def results(simulated: PreparedDataset, make_comparison: Callable[..., Path]) -> ComparisonResults:
    ids = [row["sample_id"] for row in simulated.rows]  # closed, semi_open, open, closed, ...
    wrong = {
        "pointnet": {ids[0]: "semi_open", ids[3]: "semi_open", ids[4]: "open", ids[8]: "semi_open"},
        "dgcnn": {ids[0]: "semi_open"},
    }
    return load_results(make_comparison(simulated, wrong))


def test_confusion_table(results: ComparisonResults) -> None:
    assert confusion_table(results).rows == (
        ("pointnet", "closed", "38", "2", "0", "40"),
        ("pointnet", "semi_open", "0", "39", "1", "40"),
        ("pointnet", "open", "0", "1", "39", "40"),
        ("dgcnn", "closed", "39", "1", "0", "40"),
        ("dgcnn", "semi_open", "0", "40", "0", "40"),
        ("dgcnn", "open", "0", "0", "40", "40"),
    )


def test_no_answer_is_a_column_and_a_miss(
    simulated: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    ids = [row["sample_id"] for row in simulated.rows]
    results = load_results(make_comparison(simulated, {"dgcnn": {ids[0]: ABSTAINED, ids[3]: ABSTAINED}}))
    table = confusion_table(results)
    assert table.columns[-2:] == ("no answer", "total")
    assert table.rows[3] == ("dgcnn", "closed", "38", "0", "0", "2", "40")
    closed = next(row for row in scores_table(results, simulated).rows if row[:2] == ("dgcnn", "closed"))
    found = dict(zip(scores_table(results, simulated).columns, closed, strict=True))
    assert (found["precision"], found["recall"]) == ("1.0000", "0.9500")
    assert {error.predicted for error in results.error_rows} == {ABSTAINED}
    assert all(error.confidence == 0 for error in results.error_rows)


def test_scores_table_is_scikit_learns(results: ComparisonResults, simulated: PreparedDataset) -> None:
    table = scores_table(results, simulated)
    for network in results.networks:
        pooled = results.pooled(network)
        report = classification_report(pooled.true, pooled.predicted, output_dict=True)
        for row in (row for row in table.rows if row[0] == network):
            expected = report["macro avg" if row[1] == "macro" else str(STATES.index(row[1]))]
            found = dict(zip(table.columns, row, strict=True))
            assert found["precision"] == number(expected["precision"])
            assert found["recall"] == number(expected["recall"])
            assert found["F1"] == number(expected["f1-score"])


def test_intervals_hold_their_value(results: ComparisonResults, simulated: PreparedDataset) -> None:
    table = scores_table(results, simulated)
    for row in table.rows:
        found = dict(zip(table.columns, row, strict=True))
        for name in ("precision", "recall", "F1"):
            if found[f"{name} 95% CI"] != UNDEFINED:
                low, high = map(float, found[f"{name} 95% CI"].split("–"))
                assert low <= float(found[name]) <= high


def test_summary_counts_errors(results: ComparisonResults, simulated: PreparedDataset) -> None:
    rows = summary_table(results, simulated).rows
    assert [row[:4] for row in rows] == [
        ("pointnet", "120", "4", number(116 / 120)),
        ("dgcnn", "120", "1", number(119 / 120)),
    ]


def test_folds_are_scikit_learns_and_gaps_stay_gaps(
    simulated: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    wrong = {"pointnet": {row["sample_id"]: "open" for row in simulated.rows[::9]}}
    results = load_results(
        make_comparison(simulated, wrong, networks=["pointnet"], missing=[("pointnet", 2)])
    )
    expected = [
        f1_score(run.predictions.true, run.predictions.predicted, average="macro") for run in results.runs
    ]
    assert fold_f1(results, "pointnet") == pytest.approx(expected)
    (row,) = folds_table(results).rows
    assert row[3] == UNDEFINED
    assert [row[k] for k in (1, 2, 4, 5)] == [number(value) for value in expected]
    assert row[6:] == (number(float(np.mean(expected))), number(float(np.std(expected, ddof=1))))


def test_paired_table_by_hand(results: ComparisonResults) -> None:
    # dgcnn alone is right on three samples, pointnet alone on none: p = 2 / 2^3.
    assert paired_table(results).rows == (("pointnet", "dgcnn", "120", "0", "3", "0.2500", "0.2500"),)


def test_pairs_share_samples_where_folds_are_missing(
    simulated: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    gone = [("pointnet", 0), *(("dgcnn", fold) for fold in (1, 2, 3, 4))]
    results = load_results(make_comparison(simulated, missing=gone))
    (row,) = paired_table(results).rows
    assert row[2:] == ("0", "0", "0", "1.0000", "1.0000")
