# SPDX-License-Identifier: Apache-2.0
"""Calibration of the probabilities of networks, as trained and after temperature scaling."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from doorstate.evaluation.metrics import Floats, label_codes, mean_and_deviation, ratio
from doorstate.evaluation.results import PROBABILITY_COLUMNS, Results
from doorstate.training.calibration import at_temperature, fit_temperature
from doorstate.types import STATES, Indices

BINS = 15


class Reliability(NamedTuple):
    """Samples by the probability of their predicted state, in `BINS` equal intervals from 0 to 1."""

    counts: Indices  # (BINS,)
    confidence: Floats  # (BINS,) mean probability of the predicted state, NaN in an empty bin
    accuracy: Floats  # (BINS,) share of correct predictions

    @property
    def error(self) -> float:
        """Expected calibration error: |accuracy - confidence| weighted by counts (Naeini et al. 2015)."""
        gaps = np.abs(np.nan_to_num(self.accuracy - self.confidence))
        return float((gaps * self.counts).sum() / max(1, self.counts.sum()))


def reliability(true: Indices, probabilities: Floats) -> Reliability:
    """Sort predictions into bins by their probability.

    Args:
        true: (N,) labels.
        probabilities: (N, C).
    """
    confidence = probabilities.max(axis=1)
    correct = probabilities.argmax(axis=1) == true
    place = np.clip(np.ceil(confidence * BINS).astype(np.int64) - 1, 0, BINS - 1)
    counts = np.bincount(place, minlength=BINS)
    return Reliability(
        counts,
        ratio(np.bincount(place, confidence, BINS), counts),
        ratio(np.bincount(place, correct, BINS), counts),
    )


class Calibration(NamedTuple):
    """Test predictions of a network, pooled over its folds, before and after temperature scaling of each fold."""

    true: Indices  # (N,)
    raw: Floats  # (N, 3)
    scaled: Floats  # (N, 3)
    temperatures: tuple[float, ...]  # by fold


def labels_and_probabilities(predictions: pd.DataFrame) -> tuple[Indices, Floats]:
    """Return (N,) true labels and (N, 3) probabilities of rows with a state."""
    labels = label_codes(predictions["state"], STATES)
    return labels, predictions[list(PROBABILITY_COLUMNS)].to_numpy(dtype=np.float64)


def calibrate(results: Results, method: str) -> Calibration | None:
    """Scale the test predictions of each fold by the temperature of its validation samples.

    Returns:
        None if a fold has no validation predictions.
    """
    rows = results.predictions[
        (results.predictions["method"] == method) & results.predictions["state"].isin(STATES)
    ]
    true, raw, scaled, temperatures = [], [], [], []
    for run in results.runs_of(method):
        of_fold = rows[rows["fold"] == run.fold]
        validation = of_fold[of_fold["role"] == "val"]
        if validation.empty:
            return None
        labels, probabilities = labels_and_probabilities(validation)
        temperature = fit_temperature(probabilities, labels)
        labels, probabilities = labels_and_probabilities(of_fold[of_fold["role"] == "test"])
        true.append(labels)
        raw.append(probabilities)
        scaled.append(at_temperature(probabilities, temperature))
        temperatures.append(temperature)
    return Calibration(np.concatenate(true), np.concatenate(raw), np.concatenate(scaled), tuple(temperatures))


def score_calibration(results: Results) -> pd.DataFrame:
    """Score the calibration of each network with validation predictions.

    Returns:
        Columns method, temperature_mean and temperature_deviation over folds, and expected calibration error (ece),
        cross_entropy and brier score with endings `_raw` and `_scaled`.
    """
    rows = []
    for method in results.networks:
        calibration = calibrate(results, method)
        if calibration is None:
            continue
        mean, deviation = mean_and_deviation(calibration.temperatures)
        row: dict[str, float | str] = {
            "method": method,
            "temperature_mean": mean,
            "temperature_deviation": deviation,
        }
        for name, measure in _MEASURES.items():
            row[f"{name}_raw"] = measure(calibration.true, calibration.raw)
            row[f"{name}_scaled"] = measure(calibration.true, calibration.scaled)
        rows.append(row)
    names = [f"{name}_{kind}" for name in _MEASURES for kind in ("raw", "scaled")]
    return pd.DataFrame(rows, columns=["method", "temperature_mean", "temperature_deviation", *names])


def _calibration_error(true: Indices, probabilities: Floats) -> float:
    return reliability(true, probabilities).error


def _cross_entropy(true: Indices, probabilities: Floats) -> float:
    return float(-np.log(np.maximum(probabilities[np.arange(len(true)), true], 1e-30)).mean())


def _brier(true: Indices, probabilities: Floats) -> float:
    return float(((probabilities - np.eye(probabilities.shape[1])[true]) ** 2).sum(axis=1).mean())


_MEASURES = {"ece": _calibration_error, "cross_entropy": _cross_entropy, "brier": _brier}
