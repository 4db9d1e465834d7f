# SPDX-License-Identifier: Apache-2.0
"""Temperature scaling: one number per network that makes its probabilities mean what they say (Guo et al. 2017)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

Probabilities = NDArray[np.float64]

_LOG_BOUNDS = (-3.0, 3.0)
_SMALLEST = 1e-30


def fit_temperature(probabilities: Probabilities, labels: NDArray[np.int64]) -> float:
    """Temperature of least cross entropy on samples that the weights were not fitted to.

    The targets are a little less than certain, (M + 1) / (M + C) for the true class (Platt 1999): otherwise a network
    without errors among M samples would be told to be infinitely sure.

    Args:
        probabilities: (M, C) at temperature 1.
        labels: (M,) true classes.
    """
    samples, classes = probabilities.shape
    targets = np.full((samples, classes), 1 / (samples + classes))
    targets[np.arange(samples), labels] = (samples + 1) / (samples + classes)

    def cross_entropy(log_temperature: float) -> float:
        scaled = at_temperature(probabilities, float(np.exp(log_temperature)))
        return float(-(targets * np.log(np.maximum(scaled, _SMALLEST))).sum() / samples)

    found = minimize_scalar(cross_entropy, bounds=_LOG_BOUNDS, method="bounded")
    return float(np.exp(found.x))


def at_temperature(probabilities: Probabilities, temperature: float) -> Probabilities:
    """(M, C) probabilities at another temperature: softmax(logits / T), from the softmax alone."""
    logits = np.log(np.maximum(probabilities, _SMALLEST)) / temperature
    powers = np.exp(logits - logits.max(axis=-1, keepdims=True))
    scaled: Probabilities = powers / powers.sum(axis=-1, keepdims=True)
    return scaled


def abstain_threshold(probabilities: Probabilities, labels: NDArray[np.int64], error_share: float) -> float:
    """Least probability of an answer from which on no more than a share of all answers are wrong; 0 if all may stay.

    One that no answer reaches, if even the surest are wrong too often.

    Args:
        probabilities: (M, C) of samples that the weights were not fitted to.
        labels: (M,) true classes.
        error_share: of the answers that are still given.
    """
    sure = probabilities.max(axis=1)
    order = np.argsort(-sure, kind="stable")
    wrong = (probabilities.argmax(axis=1) != labels)[order].cumsum()
    given = np.arange(1, len(sure) + 1)
    # Answers of the same probability stay or go together.
    last_of_equals = np.append(sure[order][1:] < sure[order][:-1], True)
    allowed = np.flatnonzero(last_of_equals & (wrong <= error_share * given))
    if len(allowed) == 0:
        return float(np.nextafter(sure.max(initial=0.0), 1))
    return 0.0 if allowed[-1] == len(sure) - 1 else float(sure[order][allowed[-1]])
