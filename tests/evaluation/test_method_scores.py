# SPDX-License-Identifier: Apache-2.0
"""Scores by method against scikit-learn and hand-counted cases."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.metrics import classification_report, f1_score

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.method_scores import (
    MACRO,
    confusion_counts,
    fold_scores,
    predicted_labels,
    score_states,
    summarize_methods,
)
from doorstate.evaluation.predictions import load_results
from doorstate.evaluation.results import Results
from doorstate.types import ABSTAINED, STATES
from tests.evaluation.conftest import MakeComparison


@pytest.fixture
def results(simulated: PreparedDataset, make_comparison: MakeComparison) -> Results:
    ids = [row["sample_id"] for row in simulated.rows]  # closed, semi_open, open, closed, ...
    wrong = {
        "pointnet": {ids[0]: "semi_open", ids[3]: "semi_open", ids[4]: "open", ids[8]: "semi_open"},
        "dgcnn": {ids[0]: "semi_open"},
    }
    return load_results(make_comparison(simulated, wrong))


def test_confusion_counts(results: Results) -> None:
    assert confusion_counts(results).to_numpy().tolist() == [
        ["pointnet", "closed", 38, 2, 0, 0, 40],
        ["pointnet", "semi_open", 0, 39, 1, 0, 40],
        ["pointnet", "open", 0, 1, 39, 0, 40],
        ["dgcnn", "closed", 39, 1, 0, 0, 40],
        ["dgcnn", "semi_open", 0, 40, 0, 0, 40],
        ["dgcnn", "open", 0, 0, 40, 0, 40],
    ]
    assert predicted_labels(results) == STATES


def test_an_abstention_is_a_miss_and_no_false_alarm(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    ids = [row["sample_id"] for row in simulated.rows]
    results = load_results(make_comparison(simulated, {"dgcnn": {ids[0]: ABSTAINED, ids[3]: ABSTAINED}}))
    assert predicted_labels(results) == (*STATES, ABSTAINED)
    assert confusion_counts(results)[ABSTAINED].tolist() == [0, 0, 0, 2, 0, 0]
    states = score_states(results).set_index(["method", "state"])
    assert states.loc[("dgcnn", "closed"), ["precision", "recall"]].tolist() == [1.0, 0.95]
    assert set(results.errors["predicted"]) == {ABSTAINED}
    assert (results.errors["confidence"] == 0).all()


def test_state_scores_equal_scikit_learn(results: Results) -> None:
    table = score_states(results)
    for method in results.methods:
        tested = results.tested_by(method)
        report = classification_report(tested["state"], tested["predicted"], output_dict=True)
        for row in table[table["method"] == method].to_dict("records"):
            expected = report["macro avg" if row["state"] == MACRO else row["state"]]
            assert row["precision"] == pytest.approx(expected["precision"])
            assert row["recall"] == pytest.approx(expected["recall"])
            assert row["f1"] == pytest.approx(expected["f1-score"])


def test_intervals_contain_their_value(results: Results) -> None:
    table = score_states(results)
    for name in ("precision", "recall", "f1"):
        bounded = table.dropna(subset=f"{name}_low")
        assert len(bounded) == (6 if name != "f1" else 8)
        assert bounded[name].between(bounded[f"{name}_low"], bounded[f"{name}_high"]).all()


def test_summary_counts_errors(results: Results) -> None:
    summary = summarize_methods(results)
    assert summary[["method", "samples", "errors"]].to_numpy().tolist() == [
        ["pointnet", 120, 4],
        ["dgcnn", 120, 1],
    ]
    assert summary["accuracy"].tolist() == [116 / 120, 119 / 120]


def test_fold_scores_equal_scikit_learn_and_leave_gaps(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    wrong = {"pointnet": {row["sample_id"]: "open" for row in simulated.rows[::9]}}
    results = load_results(
        make_comparison(simulated, wrong, networks=["pointnet"], missing=[("pointnet", 2)])
    )
    expected = [
        f1_score(rows["state"], rows["predicted"], average="macro")
        for _, rows in results.tested.groupby("fold")
    ]
    folds = fold_scores(results)
    assert folds["fold"].tolist() == [0, 1, 3, 4]
    assert folds["f1"].tolist() == pytest.approx(expected)
    (row,) = summarize_methods(results).to_dict("records")
    assert row["f1_mean"] == pytest.approx(np.mean(expected))
    assert row["f1_deviation"] == pytest.approx(np.std(expected, ddof=1))
