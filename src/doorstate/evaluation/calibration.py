# SPDX-License-Identifier: Apache-2.0
"""Whether a probability means what it says: expected calibration error and reliability, raw and temperature scaled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from doorstate.evaluation.metrics import Floats, mean_and_deviation, ratio
from doorstate.evaluation.results import ComparisonResults
from doorstate.evaluation.table import Table, mean_deviation, number
from doorstate.evaluation.views import graph_axes, outside_legend
from doorstate.training.calibration import at_temperature, fit_temperature
from doorstate.types import STATES, Indices

BINS = 15
FEWEST = 10  # answers of a bin that means something
_RAW, _SCALED, _INK = "#D55E00", "#0072B2", "#333333"


class Reliability(NamedTuple):
    """Samples by the probability of their answer, in `BINS` equal intervals from 0 to 1."""

    counts: Indices  # (BINS,)
    confidence: Floats  # (BINS,) mean probability of the answer, NaN where there is none
    accuracy: Floats  # (BINS,) share of right answers

    @property
    def error(self) -> float:
        """Expected calibration error: |accuracy - confidence| weighted by counts (Naeini et al. 2015)."""
        gaps = np.abs(np.nan_to_num(self.accuracy - self.confidence))
        return float((gaps * self.counts).sum() / max(1, self.counts.sum()))


def reliability(true: Indices, probabilities: Floats) -> Reliability:
    """Sort answers into bins by their probability.

    Args:
        true: (N,) labels.
        probabilities: (N, C).
    """
    confidence = probabilities.max(axis=1)
    right = probabilities.argmax(axis=1) == true
    place = np.clip(np.ceil(confidence * BINS).astype(np.int64) - 1, 0, BINS - 1)
    counts = np.bincount(place, minlength=BINS)
    return Reliability(
        counts,
        ratio(np.bincount(place, confidence, BINS), counts),
        ratio(np.bincount(place, right, BINS), counts),
    )


class Calibrated(NamedTuple):
    """One network's test answers, pooled over its folds, before and after each fold's own temperature."""

    true: Indices  # (N,)
    raw: Floats  # (N, 3)
    scaled: Floats  # (N, 3)
    temperatures: tuple[float, ...]  # by fold


def calibrate(results: ComparisonResults, network: str) -> Calibrated | None:
    """Scale every fold's test answers by the temperature of its validation answers; None if a fold has none."""
    runs = results.runs_of(network)
    temperatures = []
    for run in runs:
        if run.validation is None:
            return None
        temperatures.append(fit_temperature(run.validation.probabilities, run.validation.true))
    parts = [run.predictions for run in runs]
    return Calibrated(
        np.concatenate([part.true for part in parts]),
        np.concatenate([part.probabilities for part in parts]),
        np.concatenate(
            [at_temperature(part.probabilities, t) for part, t in zip(parts, temperatures, strict=True)]
        ),
        tuple(temperatures),
    )


def calibration_table(results: ComparisonResults) -> Table:
    """Temperature, expected calibration error, cross entropy and Brier score of every network."""
    rows = []
    for network in results.networks:
        found = calibrate(results, network)
        if found is None:
            continue
        cells = [network, mean_deviation(mean_and_deviation(found.temperatures), 3)]
        for measure in (_calibration_error, _cross_entropy, _brier):
            cells += [number(measure(found.true, found.raw)), number(measure(found.true, found.scaled))]
        rows.append(tuple(cells))
    columns = ["network", "temperature over folds"]
    for name in ("ECE", "cross entropy", "Brier score"):
        columns += [f"{name}, raw", f"{name}, scaled"]
    note = (
        f"Pooled test answers; every fold's temperature was fitted on its validation samples. ECE: {BINS} equal "
        "bins of the answer's probability. Networks are trained with label smoothing and so are less sure than they "
        "should be: temperatures below 1 sharpen."
    )
    return Table("Calibration", tuple(columns), tuple(rows), note)


def reliability_figure(results: ComparisonResults) -> Figure | None:
    """Accuracy against the probability of the answer, and how many answers have it; None without validation answers."""
    found = {network: calibrate(results, network) for network in results.networks}
    shown = {network: calibrated for network, calibrated in found.items() if calibrated is not None}
    if not shown:
        return None
    figure = Figure(figsize=(2.3 * len(shown) + 0.8, 3.9), layout="constrained")
    grid = figure.subplots(2, len(shown), squeeze=False, sharex=True, sharey="row", height_ratios=(3, 1))
    for column, (network, calibrated) in enumerate(shown.items()):
        upper, lower = grid[:, column]
        upper.plot([0, 1], [0, 1], color=_INK, linewidth=0.8, linestyle=":")
        for probabilities, color, shift in (
            (calibrated.raw, _RAW, -0.25),
            (calibrated.scaled, _SCALED, 0.25),
        ):
            bins = reliability(calibrated.true, probabilities)
            few = bins.counts < FEWEST
            sure, unsure = np.where(few, np.nan, bins.accuracy), np.where(few, bins.accuracy, np.nan)
            upper.plot(bins.confidence, sure, "o-", color=color, markersize=3.5, linewidth=1.0)
            upper.plot(bins.confidence, unsure, "o", color=color, markersize=3.5, fillstyle="none", alpha=0.5)
            centres = (np.arange(BINS) + 0.5 + shift) / BINS
            lower.bar(centres, bins.counts, width=0.5 / BINS, color=color, linewidth=0)
            upper.text(
                0.97,
                0.13 if color == _RAW else 0.04,
                f"ECE {bins.error:.4f}",
                color=color,
                fontsize=8,
                ha="right",
                transform=upper.transAxes,
            )
        upper.set(title=network, xlim=(1 / len(STATES), 1.01), ylim=(-0.02, 1.05))
        lower.set(xlabel="probability of the answer", yscale="log")
        lower.yaxis.set_major_formatter("{x:g}")
        for axis in (upper, lower):
            graph_axes(axis)
    grid[0, 0].set_ylabel("share of right answers")
    grid[1, 0].set_ylabel("answers")
    handles = [
        *(Line2D([], [], color=color, marker="o", markersize=4) for color in (_RAW, _SCALED)),
        Line2D([], [], color=_INK, marker="o", linestyle="", markersize=4, fillstyle="none", alpha=0.5),
    ]
    labels = ["as trained", "temperature scaled", f"fewer than {FEWEST} answers"]
    outside_legend(figure, handles, labels, "outside upper right")
    return figure


def _calibration_error(true: Indices, probabilities: Floats) -> float:
    return reliability(true, probabilities).error


def _cross_entropy(true: Indices, probabilities: Floats) -> float:
    return float(-np.log(np.maximum(probabilities[np.arange(len(true)), true], 1e-30)).mean())


def _brier(true: Indices, probabilities: Floats) -> float:
    return float(((probabilities - np.eye(probabilities.shape[1])[true]) ** 2).sum(axis=1).mean())
