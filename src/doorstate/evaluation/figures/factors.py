# SPDX-License-Identifier: Apache-2.0
"""Figure of accuracy by factor."""

from __future__ import annotations

import math

import pandas as pd
from matplotlib.figure import Figure

from doorstate.evaluation.factors import FACTORS, score_factors
from doorstate.evaluation.results import Results
from doorstate.evaluation.views import NETWORK_COLORS, graph_axes

_MIN_SAMPLES = 10  # of a bin that is drawn


def factors_figure(results: Results) -> Figure | None:
    """Draw the accuracy by bin of each factor: a line for each method, rules dashed; None without factors."""
    bins = score_factors(results)
    titles = [factor.title for factor in FACTORS if (bins["factor"] == factor.title).any()]
    if not titles:
        return None
    lines = -(-len(titles) // 2)
    figure = Figure(figsize=(10.0, 3.1 * lines + 0.6), layout="constrained")
    axes = figure.subplots(lines, 2, squeeze=False, sharey=True).ravel()
    for axis in axes[len(titles) :]:
        axis.remove()
    large = bins[bins["samples"] >= _MIN_SAMPLES]
    for axis, title in zip(axes, titles, strict=False):
        for order, method in enumerate(results.methods):
            x, y = _line(large[(large["method"] == method) & (large["factor"] == title)])
            axis.plot(
                x,
                y,
                "--" if method in results.config.rules else "-",
                marker="o",
                markersize=3,
                linewidth=1.2,
                color=NETWORK_COLORS.get(method, f"C{order}" if order < 10 else "black"),
                label=method,
            )
        axis.set_xlabel(title)
        graph_axes(axis)
    for axis in axes[: len(titles) : 2]:
        axis.set_ylabel("accuracy")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=min(6, len(labels)), frameon=False)
    return figure


def _line(bins: pd.DataFrame) -> tuple[list[float], list[float]]:
    """Return middles and accuracies of bins, with a gap where a bin is missing."""
    x: list[float] = []
    y: list[float] = []
    end = None
    for low, high, accuracy in zip(bins["low"], bins["high"], bins["accuracy"], strict=True):
        if end is not None and end != low:
            x.append(end)
            y.append(math.nan)
        x.append((low + high) / 2)
        y.append(accuracy)
        end = high
    return x, y
