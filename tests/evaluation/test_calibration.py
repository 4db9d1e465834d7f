# SPDX-License-Identifier: Apache-2.0
"""Calibration: bins by hand and by a plain loop, and the table and figure of a comparison."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from sklearn.metrics import log_loss

from doorstate._files import read_csv, write_csv
from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.calibration import (
    BINS,
    FEWEST,
    calibrate,
    calibration_table,
    reliability,
    reliability_figure,
)
from doorstate.evaluation.results import ComparisonResults, load_results
from doorstate.training.calibration import fit_temperature


def test_four_answers_by_hand() -> None:
    probabilities = np.array([[0.95, 0.05, 0], [0.96, 0.04, 0], [0.5, 0.3, 0.2], [0.1, 0.0, 0.9]])
    found = reliability(np.array([0, 1, 0, 2]), probabilities)
    # 0.95 and 0.96 fall into the last bin with one of two right, 0.5 and 0.9 into their own, both right.
    assert found.counts.tolist() == [0] * 7 + [1] + [0] * 5 + [1, 2]
    assert found.error == pytest.approx((2 * (0.955 - 0.5) + (1 - 0.5) + (1 - 0.9)) / 4)


def test_error_is_that_of_a_plain_loop() -> None:
    rng = np.random.default_rng(1)
    probabilities = rng.dirichlet([1, 1, 1], 500)
    true = rng.integers(0, 3, 500)
    expected = 0.0
    for low in np.arange(BINS) / BINS:
        chosen = [i for i, row in enumerate(probabilities) if low < row.max() <= low + 1 / BINS + 1e-15]
        if chosen:
            right = np.mean([probabilities[i].argmax() == true[i] for i in chosen])
            expected += len(chosen) / 500 * abs(right - np.mean([probabilities[i].max() for i in chosen]))
    assert reliability(true, probabilities).error == pytest.approx(expected)


@pytest.fixture
def results(simulated: PreparedDataset, make_comparison: Callable[..., Path]) -> ComparisonResults:
    """Right answers of 0.7 everywhere, in validation too."""
    folder = make_comparison(simulated, {"dgcnn": {"p0000-closed": "open"}})
    for fold in range(5):
        rows = read_csv(folder / "runs" / "pointnet" / f"fold{fold}" / "predictions.csv")
        write_csv(folder / "runs" / "pointnet" / f"fold{fold}" / "validation.csv", rows[:20])
    return load_results(folder)


def test_the_table_is_scikit_learns_and_leaves_out_what_it_cannot_know(results: ComparisonResults) -> None:
    (line,) = csv.DictReader(calibration_table(results).to_csv().splitlines())
    assert line["network"] == "pointnet", "dgcnn has no validation answers"
    pooled = results.pooled("pointnet")
    assert float(line["cross entropy, raw"]) == pytest.approx(
        log_loss(pooled.true, pooled.probabilities), abs=1e-4
    )
    assert float(line["ECE, raw"]) == pytest.approx(0.3, abs=1e-4)
    # Twenty samples without an error are worth (20 + 1) / (20 + 3).
    assert float(line["ECE, scaled"]) == pytest.approx(2 / 23, abs=1e-3)


def test_every_fold_has_the_temperature_of_its_own_validation_samples(results: ComparisonResults) -> None:
    found = calibrate(results, "pointnet")
    assert found is not None
    for run, temperature in zip(results.runs_of("pointnet"), found.temperatures, strict=True):
        assert run.validation is not None
        assert temperature == fit_temperature(run.validation.probabilities, run.validation.true)
    np.testing.assert_array_equal(found.scaled.argmax(1), found.raw.argmax(1))
    assert calibrate(results, "dgcnn") is None


def test_the_figure_needs_validation_answers(
    results: ComparisonResults, simulated: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    figure = reliability_figure(results)
    assert figure is not None
    assert [axis.get_title() for axis in figure.axes if axis.get_title()] == ["pointnet"]
    pooled = results.pooled("pointnet")
    few = reliability(pooled.true, pooled.probabilities).counts < FEWEST
    _, joined, hollow, *_ = figure.axes[0].lines
    assert np.isnan(np.asarray(joined.get_ydata())[few]).all()
    assert np.isnan(np.asarray(hollow.get_ydata())[~few]).all()
