# SPDX-License-Identifier: Apache-2.0
"""Temperature scaling against a grid search, against softmax of scaled logits, and on drawn labels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import expit, log_softmax, logit, softmax

from doorstate.training.calibration import (
    abstain_threshold,
    at_temperature,
    fit_door_calibration,
    fit_temperature,
)


def draw_labels(temperature: float, samples: int = 20_000) -> tuple[np.ndarray, np.ndarray]:
    """Return softmax(logits), and labels drawn from softmax(logits / temperature)."""
    rng = np.random.default_rng(0)
    logits = rng.normal(0, 3, (samples, 3))
    edges = softmax(logits / temperature, axis=1).cumsum(axis=1)
    labels = (rng.random((samples, 1)) > edges).sum(axis=1).clip(max=2)
    return softmax(logits, axis=1), labels


@pytest.mark.parametrize("temperature", [0.5, 1.0, 2.5])
def test_temperature_of_drawn_labels(temperature: float) -> None:
    assert fit_temperature(*draw_labels(temperature)) == pytest.approx(temperature, rel=0.05)


def test_temperature_is_the_minimum_of_a_grid() -> None:
    probabilities, labels = draw_labels(1.7, 200)
    fitted = fit_temperature(probabilities, labels)
    targets = np.full((200, 3), 1 / 203)
    targets[np.arange(200), labels] = 201 / 203

    def loss(temperature: float) -> float:
        return float(-(targets * log_softmax(np.log(probabilities) / temperature, axis=1)).sum())

    grid = np.geomspace(0.05, 20, 4000)
    assert fitted == pytest.approx(grid[np.argmin([loss(t) for t in grid])], rel=2e-3)


def test_without_errors_probabilities_stay_below_1() -> None:
    labels = np.arange(300) % 3
    probabilities = np.full((300, 3), 0.05)
    probabilities[np.arange(300), labels] = 0.9
    temperature = fit_temperature(probabilities, labels)
    assert 0.05 < temperature < 1
    assert at_temperature(probabilities, temperature).max() == pytest.approx(301 / 303, abs=1e-3)


@given(st.lists(st.floats(-30, 30), min_size=3, max_size=3), st.floats(0.05, 20))
def test_scaling_needs_probabilities_only(logits: list[float], temperature: float) -> None:
    row = np.array([logits])
    expected = softmax(row / temperature, axis=1)
    np.testing.assert_allclose(at_temperature(softmax(row, axis=1), temperature), expected, atol=1e-6)


def test_probability_of_0_stays_finite() -> None:
    scaled = at_temperature(np.array([[1.0, 0.0, 0.0]]), 2.0)
    assert np.isfinite(scaled).all()
    assert scaled.sum() == pytest.approx(1)


@given(
    st.lists(st.tuples(st.sampled_from([0.4, 0.5, 0.6, 0.9]), st.booleans()), min_size=1, max_size=30),
    st.sampled_from([0.0, 0.1, 0.5, 1.0]),
)
def test_threshold_keeps_as_many_predictions_as_allowed(
    predictions: list[tuple[float, bool]], error_share: float
) -> None:
    confidence = np.array([probability for probability, _ in predictions])
    correct = np.array([is_correct for _, is_correct in predictions])
    probabilities = np.stack([confidence, (1 - confidence) / 2, (1 - confidence) / 2], axis=1)
    threshold = abstain_threshold(probabilities, np.where(correct, 0, 1), error_share)
    kept = confidence >= threshold
    assert (~correct[kept]).sum() <= error_share * kept.sum()
    for lower in [0.0, *confidence[confidence < threshold]]:
        more = confidence >= lower
        if more.sum() > kept.sum():
            assert (~correct[more]).sum() > error_share * more.sum()
    assert 0 <= threshold < 1


def test_door_calibration_is_the_logistic_regression_of_drawn_doors() -> None:
    rng = np.random.default_rng(0)
    p_door, score = rng.uniform(0.02, 0.98, (2, 20_000))
    true = expit(0.6 * logit(p_door) + 1.2 * logit(score) - 1.0)
    fitted = fit_door_calibration(p_door, score, rng.random(20_000) < true)
    assert (fitted.door, fitted.score, fitted.offset) == pytest.approx((0.6, 1.2, -1.0), abs=0.1)
    np.testing.assert_allclose(fitted.probabilities(p_door, score), true, atol=0.03)


def test_door_calibration_of_candidates_that_a_line_separates_is_finite() -> None:
    p_door = np.array([0.0, 0.1, 0.9, 1.0])
    fitted = fit_door_calibration(p_door, np.full(4, 0.5), p_door > 0.5)
    probabilities = fitted.probabilities(p_door, np.full(4, 0.5))
    assert (np.diff(probabilities) >= 0).all()
    assert probabilities[1] < 0.1 < 0.9 < probabilities[2]
