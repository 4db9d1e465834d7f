# SPDX-License-Identifier: Apache-2.0
"""Figures of confusion matrices and of scores with their spread."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from doorstate.evaluation.method_scores import f1_intervals, fold_scores, predicted_labels
from doorstate.evaluation.metrics import confusion, macro_f1, ratio
from doorstate.evaluation.results import Results
from doorstate.evaluation.views import graph_axes, outside_legend
from doorstate.pages.colors import STATE_WORDS
from doorstate.types import STATES

_POOLED, _INK = "#0072B2", "#333333"


def confusion_figure(results: Results) -> Figure:
    """Draw pooled confusion matrices side by side: counts, shaded by the share of the true state."""
    methods, labels = results.methods, predicted_labels(results)
    figure = Figure(figsize=(0.83 * len(labels) * len(methods) + 0.6, 3.2), layout="compressed")
    axes = figure.subplots(1, len(methods), squeeze=False, sharey=True)[0]
    for axis, method in zip(axes, methods, strict=True):
        counts = confusion(results.tested_by(method))[:, : len(labels)]
        share = np.nan_to_num(ratio(counts, counts.sum(axis=1, keepdims=True)))
        axis.imshow(share, cmap="Blues", vmin=0.0, vmax=1.0)
        for (i, j), count in np.ndenumerate(counts):
            axis.text(
                j, i, str(count), ha="center", va="center", color="white" if share[i, j] > 0.5 else "black"
            )
        axis.set(title=method, xlabel="predicted", xticks=range(len(labels)), yticks=range(len(STATES)))
        axis.set_xticklabels([STATE_WORDS[label] for label in labels], fontsize=8)
        axis.set_yticklabels([STATE_WORDS[state] for state in STATES], fontsize=8)
    axes[0].set_ylabel("true")
    return figure


def spread_figure(results: Results) -> Figure:
    """Draw the macro F1 of each method: pooled with its 95 % interval, and each fold."""
    methods, by_fold = results.methods, fold_scores(results)
    figure = Figure(figsize=(7.0, 0.45 * len(methods) + 1.0), layout="constrained")
    axis = figure.subplots()
    for line, method in enumerate(methods):
        folds = by_fold.loc[by_fold["method"] == method, "f1"].to_numpy()
        pooled = macro_f1(results.tested_by(method))
        low, high = f1_intervals(results, method).macro
        axis.plot([low, high], [line, line], color=_POOLED, linewidth=5, alpha=0.35, solid_capstyle="butt")
        axis.plot(folds, np.full(len(folds), line), "o", markersize=4.5, markerfacecolor="none", color=_INK)
        axis.plot(pooled, line, "D", color=_POOLED, markersize=6)
    axis.set(xlabel="macro F1", yticks=range(len(methods)), ylim=(len(methods) - 0.5, -0.5))
    axis.set_yticklabels(methods)
    graph_axes(axis, "x")
    handles = [
        Line2D([], [], marker="D", linestyle="", color=_POOLED),
        Line2D([], [], color=_POOLED, linewidth=5, alpha=0.35),
        Line2D([], [], marker="o", linestyle="", markerfacecolor="none", color=_INK),
    ]
    outside_legend(figure, handles, ["pooled", "95 % interval", "one fold"], "outside upper right")
    return figure
