# SPDX-License-Identifier: Apache-2.0
"""Published numbers follow from the committed predictions."""

from __future__ import annotations

from pathlib import Path

import pytest

from doorstate.evaluation.calibration import score_calibration
from doorstate.evaluation.method_scores import confusion_counts, summarize_methods
from doorstate.evaluation.pairwise import pairwise_tests
from doorstate.evaluation.predictions import load_results
from doorstate.evaluation.results import Results
from doorstate.evaluation.strata import score_strata
from doorstate.evaluation.undecidable import decidable_accuracy

RESULTS = Path(__file__).resolve().parents[2] / "results"


@pytest.fixture(scope="module")
def paper() -> Results:
    return load_results(RESULTS / "paper")


def test_summary(paper: Results) -> None:
    summary = summarize_methods(paper).set_index("method")
    assert list(summary.index) == ["pointnet", "pointnet2", "dgcnn", "pointcnn", "point2sequence"]
    assert summary["errors"].tolist() == [35, 11, 38, 31, 31]
    numbers = ["f1", "accuracy_low", "accuracy_high", "f1_low", "f1_high", "f1_mean", "f1_deviation"]
    assert summary.loc["pointnet2", numbers].round(4).tolist() == [
        *(0.9973, 0.9952, 0.9985, 0.9956, 0.9988),
        *(0.9973, 0.0022),
    ]
    assert summary.loc["dgcnn", numbers].round(4).tolist() == [
        *(0.9906, 0.9872, 0.9932, 0.9874, 0.9933),
        *(0.9906, 0.0081),
    ]


def test_confusion(paper: Results) -> None:
    counts = confusion_counts(paper).set_index(["method", "state"]).loc["pointnet2"]
    assert counts.to_numpy().tolist() == [
        [1353, 0, 0, 0, 1353],
        [2, 1345, 6, 0, 1353],
        [0, 3, 1350, 0, 1353],
    ]


def test_paired_tests(paper: Results) -> None:
    tests = pairwise_tests(paper).set_index(["first", "second"])
    row = tests.loc[("pointnet2", "pointcnn")]
    assert row[["samples", "only_first_correct", "only_second_correct"]].tolist() == [4059, 29, 9]
    assert row[["p", "p_holm"]].round(4).tolist() == [0.0017, 0.0116]


def test_strata_and_ceiling(paper: Results) -> None:
    strata = score_strata(paper, "semi_open").set_index(["method", "region", "band"])
    assert strata.loc[("pointnet2", "all", "all"), ["hits", "state_samples"]].tolist() == [1345, 1353]
    assert len(decidable_accuracy(paper)) == 5


def test_calibration(paper: Results) -> None:
    calibration = score_calibration(paper).set_index("method").loc["pointnet2"]
    assert calibration[["temperature_mean", "temperature_deviation"]].round(3).tolist() == [0.555, 0.018]
    assert calibration[["ece_raw", "ece_scaled"]].round(4).tolist() == [0.0698, 0.0078]
    assert calibration[["cross_entropy_scaled", "brier_scaled"]].round(4).tolist() == [0.0161, 0.0055]
