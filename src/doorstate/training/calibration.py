# SPDX-License-Identifier: Apache-2.0
"""Calibration: temperature of the states (Guo et al. 2017), least probability of an answer, probability of a door."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize, minimize_scalar
from scipy.special import expit

from doorstate.networks.door_calibration import DoorCalibration, door_features

Probabilities = NDArray[np.float64]

_LOG_BOUNDS = (-3.0, 3.0)
_SMALLEST = 1e-30
_RIDGE = 1e-5


def fit_temperature(probabilities: Probabilities, labels: NDArray[np.int64]) -> float:
    """Return the temperature with the least cross entropy on held-out samples.

    The target of the true class is (M + 1) / (M + C), as in Platt 1999; with a target of 1 the temperature of a network
    without errors on the M samples would be 0.

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

    minimum = minimize_scalar(cross_entropy, bounds=_LOG_BOUNDS, method="bounded")
    return float(np.exp(minimum.x))


def at_temperature(probabilities: Probabilities, temperature: float) -> Probabilities:
    """Return softmax(logits / temperature) for (M, C) probabilities softmax(logits)."""
    logits = np.log(np.maximum(probabilities, _SMALLEST)) / temperature
    powers = np.exp(logits - logits.max(axis=-1, keepdims=True))
    scaled: Probabilities = powers / powers.sum(axis=-1, keepdims=True)
    return scaled


def abstain_threshold(probabilities: Probabilities, labels: NDArray[np.int64], error_share: float) -> float:
    """Return the lowest probability from which on at most a share of the predictions is wrong.

    0 if all predictions may be kept; a value above all probabilities if none may.

    Args:
        probabilities: (M, C) of held-out samples.
        labels: (M,) true classes.
        error_share: largest share of wrong predictions among those kept.
    """
    confidence = probabilities.max(axis=1)
    order = np.argsort(-confidence, kind="stable")
    errors = (probabilities.argmax(axis=1) != labels)[order].cumsum()
    kept = np.arange(1, len(confidence) + 1)
    # Predictions with the same probability are kept or dropped together.
    last_of_equals = np.append(confidence[order][1:] < confidence[order][:-1], True)
    allowed = np.flatnonzero(last_of_equals & (errors <= error_share * kept))
    if len(allowed) == 0:
        return float(np.nextafter(confidence.max(initial=0.0), 1))
    return 0.0 if allowed[-1] == len(confidence) - 1 else float(confidence[order][allowed[-1]])


def fit_door_calibration(
    p_door: NDArray[np.float64], score: NDArray[np.float64], is_door: NDArray[np.bool_]
) -> DoorCalibration:
    """Return the logistic regression with the least cross entropy on held-out candidates.

    A weak ridge keeps it finite where a line separates doors from the rest.

    Args:
        p_door: (M,) probabilities of the head `door`.
        score: (M,) scores of the finder.
        is_door: (M,) True for doors.
    """
    inputs = door_features(p_door, score)
    signs = np.where(is_door, 1.0, -1.0)

    def loss(weights: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        margins = signs * (inputs @ weights)
        cross_entropy = np.logaddexp(0, -margins).mean()
        gradient = -(inputs * (signs * expit(-margins))[:, None]).mean(axis=0)
        return float(cross_entropy + _RIDGE * weights @ weights), gradient + 2 * _RIDGE * weights

    door, finder, offset = minimize(loss, np.array([1.0, 1.0, 0.0]), jac=True).x
    return DoorCalibration(door=round(door, 4), score=round(finder, 4), offset=round(offset, 4))
