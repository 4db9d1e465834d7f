# SPDX-License-Identifier: Apache-2.0
"""Figure of learning curves."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from doorstate.evaluation.results import Results, RunRecord
from doorstate.evaluation.views import graph_axes, outside_legend

_TICKS = (0.0, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
_TRAINING, _VALIDATION, _INK = "#0072B2", "#D55E00", "#333333"


def learning_figure(results: Results) -> Figure:
    """Draw losses and 1 - macro F1 by epoch: a line for each fold, a dot at the selected epoch."""
    methods = results.methods
    figure = Figure(figsize=(2.6 * len(methods) + 0.8, 4.4), layout="constrained")
    grid = figure.subplots(2, len(methods), squeeze=False, sharex="col", sharey="row")
    for column, method in enumerate(methods):
        losses, deficits = grid[:, column]
        for run in results.runs_of(method):
            _draw_log(losses, run, "train_loss", _TRAINING)
            _draw_log(losses, run, "val_loss", _VALIDATION)
            _draw_log(deficits, run, "val_macro_f1", _VALIDATION, deficit=True)
        losses.set(title=method, yscale="log")
        losses.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        losses.yaxis.set_major_formatter("{x:g}")
        losses.yaxis.set_minor_locator(NullLocator())
        # Linear up to 0.01: a linear axis hides the differences of good networks, a logarithmic one has no 0.
        deficits.set(xlabel="epoch")
        deficits.set_yscale("symlog", linthresh=0.01)
        deficits.set_yticks(_TICKS, [f"{tick:g}" for tick in _TICKS])
        deficits.yaxis.set_minor_locator(NullLocator())
        deficits.xaxis.set_major_locator(MaxNLocator(6, integer=True))
        for axis in (losses, deficits):
            graph_axes(axis)
            if not axis.lines:
                axis.text(
                    0.5, 0.5, "no log", transform=axis.transAxes, ha="center", va="center", color="gray"
                )
    grid[0, 0].set_ylabel("loss")
    grid[1, 0].set_ylabel("1 − macro F1")
    grid[1, 0].set_ylim(bottom=-0.001)  # room for a dot at 0
    handles = [
        *(Line2D([], [], color=color) for color in (_TRAINING, _VALIDATION)),
        Line2D([], [], marker="o", linestyle="", markersize=3.5, color=_INK),
    ]
    labels = ["training", "validation", "selected epoch"]
    outside_legend(figure, handles, labels, "outside upper right")
    return figure


def _draw_log(axis: Axes, run: RunRecord, column: str, color: str, deficit: bool = False) -> None:
    if column not in run.log:
        return
    epochs, values = run.log["epoch"].to_numpy(), run.log[column].to_numpy()
    if deficit:
        values = 1 - values
    axis.plot(epochs, values, color=color, alpha=0.7, linewidth=1.0)
    selected = epochs == run.metric("best_epoch")
    axis.plot(epochs[selected], values[selected], "o", color=color, markersize=3.5)
