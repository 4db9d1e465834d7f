# SPDX-License-Identifier: Apache-2.0
"""Reliability diagram: accuracy against the probability of the predicted state, raw and temperature scaled."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from doorstate.evaluation.calibration import BINS, calibrate, reliability
from doorstate.evaluation.results import Results
from doorstate.evaluation.views import graph_axes, outside_legend
from doorstate.types import STATES

_MIN_SAMPLES = 10  # of a bin that is joined to the line
_RAW, _SCALED, _INK = "#D55E00", "#0072B2", "#333333"


def reliability_figure(results: Results) -> Figure | None:
    """Draw accuracy against the probability of the predicted state, and the number of predictions.

    Returns:
        None without validation predictions.
    """
    calibrations = [(method, calibrate(results, method)) for method in results.methods]
    columns = [(method, calibration) for method, calibration in calibrations if calibration is not None]
    if not columns:
        return None
    figure = Figure(figsize=(2.3 * len(columns) + 0.8, 3.9), layout="constrained")
    grid = figure.subplots(2, len(columns), squeeze=False, sharex=True, sharey="row", height_ratios=(3, 1))
    for column, (method, calibration) in enumerate(columns):
        upper, lower = grid[:, column]
        upper.plot([0, 1], [0, 1], color=_INK, linewidth=0.8, linestyle=":")
        for probabilities, color, shift in (
            (calibration.raw, _RAW, -0.25),
            (calibration.scaled, _SCALED, 0.25),
        ):
            bins = reliability(calibration.true, probabilities)
            few = bins.counts < _MIN_SAMPLES
            solid, hollow = np.where(few, np.nan, bins.accuracy), np.where(few, bins.accuracy, np.nan)
            upper.plot(bins.confidence, solid, "o-", color=color, markersize=3.5, linewidth=1.0)
            upper.plot(bins.confidence, hollow, "o", color=color, markersize=3.5, fillstyle="none", alpha=0.5)
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
        upper.set(title=method, xlim=(1 / len(STATES), 1.01), ylim=(-0.02, 1.05))
        lower.set(xlabel="probability of the predicted state", yscale="log")
        lower.yaxis.set_major_formatter("{x:g}")
        for axis in (upper, lower):
            graph_axes(axis)
    grid[0, 0].set_ylabel("share of correct predictions")
    grid[1, 0].set_ylabel("predictions")
    handles = [
        *(Line2D([], [], color=color, marker="o", markersize=4) for color in (_RAW, _SCALED)),
        Line2D([], [], color=_INK, marker="o", linestyle="", markersize=4, fillstyle="none", alpha=0.5),
    ]
    labels = ["as trained", "temperature scaled", f"fewer than {_MIN_SAMPLES} predictions"]
    outside_legend(figure, handles, labels, "outside upper right")
    return figure
