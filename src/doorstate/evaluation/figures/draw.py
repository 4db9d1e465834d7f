# SPDX-License-Identifier: Apache-2.0
"""Figures for paper and report, drawn without global state; the same inputs give the same bytes."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from doorstate._files import atomic_path
from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.calibration import reliability_figure
from doorstate.evaluation.errors_figure import common_errors_figure, surest_errors_figure
from doorstate.evaluation.factors import factors_figure
from doorstate.evaluation.metrics import ratio, scores
from doorstate.evaluation.plan_figures import error_map, poses_figure
from doorstate.evaluation.results import ComparisonResults, Run
from doorstate.evaluation.samples_figure import samples_figure
from doorstate.evaluation.score_tables import answers_given, f1_intervals, fold_f1, pooled_confusion
from doorstate.evaluation.views import STATE_WORDS, graph_axes, outside_legend
from doorstate.types import STATES

_DPI = 160
_PICTURE_DPI = 110  # figures full of pictures are megabytes otherwise
_PICTURES = ("figure2_samples", "figure3_misclassified", "figure4_missed_by_most")
_LACKING = (0.0, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)  # ticks
_TRAINING, _VALIDATION, _INK = "#0072B2", "#D55E00", "#333333"


class Drawing(NamedTuple):
    """One figure as the bytes of two files."""

    png: bytes
    svg: bytes


def draw_figures(
    results: ComparisonResults, dataset: PreparedDataset, of_dataset: Mapping[str, Drawing] | None = None
) -> dict[str, Drawing]:
    """Draw every figure that the data allow, by the name of its files.

    Args:
        results: a checked comparison.
        dataset: the prepared data set that it was trained on.
        of_dataset: what `draw_dataset` gave, if it is drawn already.
    """
    figures: dict[str, Figure | None] = {
        "confusion": confusion_figure(results),
        "spread": spread_figure(results, dataset),
        "learning_curves": learning_figure(results),
        "reliability": reliability_figure(results),
        "figure3_misclassified": surest_errors_figure(results, dataset),
        "figure4_missed_by_most": common_errors_figure(results, dataset),
        "errors_in_plan": error_map(results, dataset),
        "factors": factors_figure(results, dataset),
    }
    return {**(draw_dataset(dataset) if of_dataset is None else of_dataset), **encode_figures(figures)}


def draw_dataset(dataset: PreparedDataset) -> dict[str, Drawing]:
    """Draw Figures 1 and 2, which need no results, as far as the data set has poses."""
    return encode_figures(
        {"figure1_poses": poses_figure(dataset), "figure2_samples": samples_figure(dataset)}
    )


def write_figures(
    results: ComparisonResults,
    dataset: PreparedDataset,
    folder: Path,
    of_dataset: Mapping[str, Drawing] | None = None,
) -> dict[str, Drawing]:
    """Write `<name>.png` and `<name>.svg` of every figure; the same inputs give the same bytes.

    Args:
        results: a checked comparison.
        dataset: the prepared data set that it was trained on.
        folder: where the files go; made if absent.
        of_dataset: what `draw_dataset` gave, if it is drawn already.
    """
    drawings = draw_figures(results, dataset, of_dataset)
    save_drawings(drawings, folder)
    return drawings


def save_drawings(drawings: Mapping[str, Drawing], folder: Path) -> None:
    """Write `<name>.png` and `<name>.svg` of every figure."""
    for name, drawing in drawings.items():
        for ending, content in drawing._asdict().items():
            with atomic_path(folder / f"{name}.{ending}") as temporary:
                temporary.write_bytes(content)


def encode_figures(figures: Mapping[str, Figure | None]) -> dict[str, Drawing]:
    """Turn figures into files that are the same each time they are drawn; those that are None are left out."""
    return {
        name: _encode(figure, _PICTURE_DPI if name in _PICTURES else _DPI)
        for name, figure in figures.items()
        if figure is not None
    }


def _encode(figure: Figure, dpi: int) -> Drawing:
    """Draw once for each file; `savefig` goes through every artist twice, once only to find the layout again."""
    png, svg = io.BytesIO(), io.BytesIO()
    figure.dpi = dpi
    FigureCanvasAgg(figure).print_png(png, metadata={"Software": None})  # type: ignore[no-untyped-call]
    figure.set_layout_engine("none")  # it is laid out
    # Without salt and with a date, element names and metadata would differ from run to run.
    with mpl.rc_context({"svg.hashsalt": "doorstate"}):
        FigureCanvasSVG(figure).print_svg(svg, metadata={"Date": None, "Creator": None})  # type: ignore[no-untyped-call]
    return Drawing(png.getvalue(), svg.getvalue())


def confusion_figure(results: ComparisonResults) -> Figure:
    """Pooled confusion matrices side by side: counts, shaded by the share of the true state."""
    networks, shown = results.networks, answers_given(results)
    figure = Figure(figsize=(0.83 * len(shown) * len(networks) + 0.6, 3.2), layout="compressed")
    axes = figure.subplots(1, len(networks), squeeze=False, sharey=True)[0]
    for axis, network in zip(axes, networks, strict=True):
        counts = pooled_confusion(results, network)[:, : len(shown)]
        share = np.nan_to_num(ratio(counts, counts.sum(axis=1, keepdims=True)))
        axis.imshow(share, cmap="Blues", vmin=0.0, vmax=1.0)
        for (i, j), count in np.ndenumerate(counts):
            axis.text(
                j, i, str(count), ha="center", va="center", color="white" if share[i, j] > 0.5 else "black"
            )
        axis.set(title=network, xlabel="predicted", xticks=range(len(shown)), yticks=range(len(STATES)))
        axis.set_xticklabels([STATE_WORDS[answer].replace(" ", "\n") for answer in shown], fontsize=8)
        axis.set_yticklabels([STATE_WORDS[state] for state in STATES], fontsize=8)
    axes[0].set_ylabel("true")
    return figure


def spread_figure(results: ComparisonResults, dataset: PreparedDataset) -> Figure:
    """Macro-F1 of each network: pooled with its 95 % interval, and each fold."""
    networks = results.networks
    figure = Figure(figsize=(7.0, 0.45 * len(networks) + 1.0), layout="constrained")
    axis = figure.subplots()
    for line, network in enumerate(networks):
        folds = fold_f1(results, network)
        pooled = float(scores(pooled_confusion(results, network)).macro.f1)
        low, high = f1_intervals(results, dataset, network).macro
        axis.plot([low, high], [line, line], color=_TRAINING, linewidth=5, alpha=0.35, solid_capstyle="butt")
        axis.plot(folds, np.full(len(folds), line), "o", markersize=4.5, markerfacecolor="none", color=_INK)
        axis.plot(pooled, line, "D", color=_TRAINING, markersize=6)
    axis.set(xlabel="macro F1", yticks=range(len(networks)), ylim=(len(networks) - 0.5, -0.5))
    axis.set_yticklabels(networks)
    graph_axes(axis, "x")
    handles = [
        Line2D([], [], marker="D", linestyle="", color=_TRAINING),
        Line2D([], [], color=_TRAINING, linewidth=5, alpha=0.35),
        Line2D([], [], marker="o", linestyle="", markerfacecolor="none", color=_INK),
    ]
    outside_legend(figure, handles, ["pooled", "95 % interval", "one fold"], "outside upper right")
    return figure


def learning_figure(results: ComparisonResults) -> Figure:
    """Losses and what macro-F1 lacks of 1 by epoch, a line for each fold, a dot at the epoch that was kept."""
    networks = results.networks
    figure = Figure(figsize=(2.6 * len(networks) + 0.8, 4.4), layout="constrained")
    grid = figure.subplots(2, len(networks), squeeze=False, sharex="col", sharey="row")
    for column, network in enumerate(networks):
        losses, lacking = grid[:, column]
        for run in results.runs_of(network):
            _draw_log(losses, run, "train_loss", _TRAINING)
            _draw_log(losses, run, "val_loss", _VALIDATION)
            _draw_log(lacking, run, "val_macro_f1", _VALIDATION, lacking=True)
        losses.set(title=network, yscale="log")
        losses.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        losses.yaxis.set_major_formatter("{x:g}")
        losses.yaxis.set_minor_locator(NullLocator())
        # Linear up to 0.01: on a linear axis all good networks look alike, on a logarithmic one 0 has no place.
        lacking.set(xlabel="epoch")
        lacking.set_yscale("symlog", linthresh=0.01)
        lacking.set_yticks(_LACKING, [f"{each:g}" for each in _LACKING])
        lacking.yaxis.set_minor_locator(NullLocator())
        lacking.xaxis.set_major_locator(MaxNLocator(6, integer=True))
        for axis in (losses, lacking):
            graph_axes(axis)
            if not axis.lines:
                axis.text(
                    0.5, 0.5, "no log", transform=axis.transAxes, ha="center", va="center", color="gray"
                )
    grid[0, 0].set_ylabel("loss")
    grid[1, 0].set_ylabel("1 − macro F1")
    grid[1, 0].set_ylim(bottom=-0.001)  # room for a dot at 0, not for less than nothing
    handles = [
        *(Line2D([], [], color=color) for color in (_TRAINING, _VALIDATION)),
        Line2D([], [], marker="o", linestyle="", markersize=3.5, color=_INK),
    ]
    labels = ["training", "validation", "the epoch that was kept"]
    outside_legend(figure, handles, labels, "outside upper right")
    return figure


def _draw_log(axis: Axes, run: Run, column: str, color: str, lacking: bool = False) -> None:
    if column not in run.log:
        return
    epochs, values = run.log["epoch"], 1 - run.log[column] if lacking else run.log[column]
    axis.plot(epochs, values, color=color, alpha=0.7, linewidth=1.0)
    kept = epochs == run.metric("best_epoch")
    axis.plot(epochs[kept], values[kept], "o", color=color, markersize=3.5)
