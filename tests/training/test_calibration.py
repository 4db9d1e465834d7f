# SPDX-License-Identifier: Apache-2.0
"""Temperature scaling against a grid search, softmax of scaled logits, and data with a known answer."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import log_softmax, softmax

from doorstate.training.calibration import abstain_threshold, at_temperature, fit_temperature


def drawn(temperature: float, samples: int = 20_000) -> tuple[np.ndarray, np.ndarray]:
    """Labels drawn from softmax(logits / temperature), and the probabilities of a network that says softmax(logits)."""
    rng = np.random.default_rng(0)
    logits = rng.normal(0, 3, (samples, 3))
    edges = softmax(logits / temperature, axis=1).cumsum(axis=1)
    labels = (rng.random((samples, 1)) > edges).sum(axis=1).clip(max=2)
    return softmax(logits, axis=1), labels


@pytest.mark.parametrize("temperature", [0.5, 1.0, 2.5])
def test_the_temperature_that_made_the_labels_is_found(temperature: float) -> None:
    assert fit_temperature(*drawn(temperature)) == pytest.approx(temperature, rel=0.05)


def test_it_is_the_minimum_of_a_grid() -> None:
    probabilities, labels = drawn(1.7, 200)
    found = fit_temperature(probabilities, labels)
    targets = np.full((200, 3), 1 / 203)
    targets[np.arange(200), labels] = 201 / 203

    def loss(temperature: float) -> float:
        return float(-(targets * log_softmax(np.log(probabilities) / temperature, axis=1)).sum())

    grid = np.geomspace(0.05, 20, 4000)
    assert found == pytest.approx(grid[np.argmin([loss(t) for t in grid])], rel=2e-3)


def test_without_errors_it_sharpens_but_never_to_certainty() -> None:
    labels = np.arange(300) % 3
    probabilities = np.full((300, 3), 0.05)
    probabilities[np.arange(300), labels] = 0.9
    temperature = fit_temperature(probabilities, labels)
    assert 0.05 < temperature < 1
    assert at_temperature(probabilities, temperature).max() == pytest.approx(301 / 303, abs=1e-3)


@given(st.lists(st.floats(-30, 30), min_size=3, max_size=3), st.floats(0.05, 20))
@settings(deadline=None)
def test_probabilities_alone_are_enough(logits: list[float], temperature: float) -> None:
    row = np.array([logits])
    expected = softmax(row / temperature, axis=1)
    np.testing.assert_allclose(at_temperature(softmax(row, axis=1), temperature), expected, atol=1e-6)


def test_a_probability_of_zero_is_no_error() -> None:
    scaled = at_temperature(np.array([[1.0, 0.0, 0.0]]), 2.0)
    assert np.isfinite(scaled).all()
    assert scaled.sum() == pytest.approx(1)


@given(
    st.lists(st.tuples(st.sampled_from([0.4, 0.5, 0.6, 0.9]), st.booleans()), min_size=1, max_size=30),
    st.sampled_from([0.0, 0.1, 0.5, 1.0]),
)
def test_the_threshold_keeps_as_many_answers_as_it_may(
    answers: list[tuple[float, bool]], error_share: float
) -> None:
    sure = np.array([each for each, _ in answers])
    right = np.array([each for _, each in answers])
    probabilities = np.stack([sure, (1 - sure) / 2, (1 - sure) / 2], axis=1)
    found = abstain_threshold(probabilities, np.where(right, 0, 1), error_share)
    kept = sure >= found
    assert (~right[kept]).sum() <= error_share * kept.sum()
    for lower in [0.0, *sure[sure < found]]:
        more = sure >= lower
        if more.sum() > kept.sum():
            assert (~right[more]).sum() > error_share * more.sum()
    assert 0 <= found < 1
