# SPDX-License-Identifier: Apache-2.0
"""Calibration: bins by hand and by a plain loop, and scores against scikit-learn."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.metrics import log_loss

from doorstate._files import read_csv, write_csv
from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.calibration import (
    BINS,
    calibrate,
    labels_and_probabilities,
    reliability,
    score_calibration,
)
from doorstate.evaluation.figures.reliability import reliability_figure
from doorstate.evaluation.predictions import load_results
from doorstate.evaluation.results import Results
from doorstate.training.calibration import fit_temperature
from tests.evaluation.conftest import MakeComparison


def test_four_predictions_by_hand() -> None:
    probabilities = np.array([[0.95, 0.05, 0], [0.96, 0.04, 0], [0.5, 0.3, 0.2], [0.1, 0.0, 0.9]])
    bins = reliability(np.array([0, 1, 0, 2]), probabilities)
    # 0.95 and 0.96 fall into the last bin with one of two correct, 0.5 and 0.9 into their own, both correct.
    assert bins.counts.tolist() == [0] * 7 + [1] + [0] * 5 + [1, 2]
    assert bins.error == pytest.approx((2 * (0.955 - 0.5) + (1 - 0.5) + (1 - 0.9)) / 4)


def test_error_equals_a_plain_loop() -> None:
    rng = np.random.default_rng(1)
    probabilities = rng.dirichlet([1, 1, 1], 500)
    true = rng.integers(0, 3, 500)
    expected = 0.0
    for low in np.arange(BINS) / BINS:
        chosen = [i for i, row in enumerate(probabilities) if low < row.max() <= low + 1 / BINS + 1e-15]
        if chosen:
            correct = np.mean([probabilities[i].argmax() == true[i] for i in chosen])
            expected += len(chosen) / 500 * abs(correct - np.mean([probabilities[i].max() for i in chosen]))
    assert reliability(true, probabilities).error == pytest.approx(expected)


@pytest.fixture
def results(simulated: PreparedDataset, make_comparison: MakeComparison) -> Results:
    """Correct predictions of probability 0.7 everywhere, in validation too."""
    folder = make_comparison(simulated, {"dgcnn": {"p0000-closed": "open"}})
    predictions = [
        row
        for path in sorted((folder / "runs" / "pointnet").rglob("predictions.csv"))
        for row in read_csv(path)
    ]
    splits = read_csv(folder / "splits.csv")
    for fold in range(5):
        validated = {row["sample_id"] for row in splits if row[f"fold_{fold}"] == "val"}
        rows = [row for row in predictions if row["sample_id"] in validated]
        write_csv(folder / "runs" / "pointnet" / f"fold{fold}" / "validation.csv", rows)
    return load_results(folder)


def test_scores_equal_scikit_learn_and_need_validation_predictions(results: Results) -> None:
    (row,) = score_calibration(results).to_dict("records")
    assert row["method"] == "pointnet"
    true, probabilities = labels_and_probabilities(results.tested_by("pointnet"))
    assert row["cross_entropy_raw"] == pytest.approx(log_loss(true, probabilities))
    assert row["ece_raw"] == pytest.approx(0.3)
    # Twelve samples without an error are worth (12 + 1) / (12 + 3).
    assert row["ece_scaled"] == pytest.approx(2 / 15, abs=1e-3)


def test_each_fold_has_the_temperature_of_its_own_validation_samples(results: Results) -> None:
    calibration = calibrate(results, "pointnet")
    assert calibration is not None
    frame = results.predictions
    for fold, temperature in enumerate(calibration.temperatures):
        rows = frame[(frame["method"] == "pointnet") & (frame["fold"] == fold) & (frame["role"] == "val")]
        true, probabilities = labels_and_probabilities(rows)
        assert temperature == fit_temperature(probabilities, true)
    np.testing.assert_array_equal(calibration.scaled.argmax(1), calibration.raw.argmax(1))
    assert calibrate(results, "dgcnn") is None


def test_figure_joins_only_full_bins(results: Results) -> None:
    figure = reliability_figure(results)
    assert figure is not None
    assert [axis.get_title() for axis in figure.axes if axis.get_title()] == ["pointnet"]
    few = reliability(*labels_and_probabilities(results.tested_by("pointnet"))).counts < 10
    _, joined, hollow, *_ = figure.axes[0].lines
    assert np.isnan(np.asarray(joined.get_ydata())[few]).all()
    assert np.isnan(np.asarray(hollow.get_ydata())[~few]).all()
