# SPDX-License-Identifier: Apache-2.0
"""Trained on one thing, tested on another: macro-F1 of every pair of a transfer study."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from doorstate.errors import RunError
from doorstate.evaluation.figures import encode_figures, save_drawings
from doorstate.evaluation.metrics import scores
from doorstate.evaluation.results import load_results
from doorstate.evaluation.score_tables import pooled_confusion
from doorstate.evaluation.table import Table, number
from doorstate.evaluation.tables import save_tables
from doorstate.training.run_folder import read_json

_NAN = float("nan")


@dataclass(frozen=True)
class TransferResults:
    """Macro-F1 by (network, trained, tested), and how many samples of each data set were tested."""

    networks: tuple[str, ...]
    trained: tuple[str, ...]
    tested: tuple[str, ...]
    macro_f1: dict[tuple[str, str, str], float]
    samples: dict[str, int]

    def trainings(self, network: str) -> tuple[str, ...]:
        """Those that the network was part of."""
        return tuple(
            row
            for row in self.trained
            if any((network, row, column) in self.macro_f1 for column in self.tested)
        )


def load_transfer_results(
    folder: Path, trained: Sequence[str], tested: Sequence[str], datasets_folder: Path | None = None
) -> TransferResults:
    """Read the comparisons of a study; what is not there yet is left out.

    Args:
        folder: of the study, which holds `<trained>/<tested>/`.
        trained: names, in the order of rows.
        tested: names, in the order of columns.
        datasets_folder: holds the data sets by the last part of their names, if they are not where comparisons say.

    Raises:
        RunError: nothing is there, or a comparison cannot be used.
    """
    networks: dict[str, None] = {}
    macro_f1: dict[tuple[str, str, str], float] = {}
    samples: dict[str, int] = {}
    for row in trained:
        for column in tested:
            cell = folder / row / column
            if not any(cell.glob("runs/*/*/predictions.csv")):
                continue
            dataset = Path(read_json(cell / "comparison.json")["dataset"]).name
            results = load_results(cell, None if datasets_folder is None else datasets_folder / dataset)
            for network in results.networks:
                networks[network] = None
                confusion = pooled_confusion(results, network)
                macro_f1[network, row, column] = float(scores(confusion).macro.f1)
                samples[column] = int(confusion.sum())
    if not networks:
        raise RunError(f"{folder}: holds no finished part of a transfer study")
    return TransferResults(tuple(networks), tuple(trained), tuple(tested), macro_f1, samples)


def transfer_table(results: TransferResults) -> Table:
    """A line for each network and training, a column for each data set."""
    rows = tuple(
        (
            network,
            row,
            *(number(results.macro_f1.get((network, row, column), _NAN)) for column in results.tested),
        )
        for network in results.networks
        for row in results.trainings(network)
    )
    counts = ", ".join(
        f"{name} {results.samples[name]}" for name in results.tested if name in results.samples
    )
    return Table(
        "Macro F1 by what was trained on and what was tested on",
        ("network", "trained on", *results.tested),
        rows,
        "A column tests the same samples of all weights; none of the trainings has seen their scenes. Samples with a "
        f"door: {counts}.",
        text_columns=2,
    )


def transfer_figure(results: TransferResults) -> Figure:
    """One grid of numbers for each network, the darker the better."""
    lines = [len(results.trainings(network)) for network in results.networks]
    width = 0.75 * len(results.tested) + 1.6
    height = 0.36 * sum(lines) + 0.5 * len(lines) + 0.9
    figure = Figure(figsize=(width, height), layout="constrained")
    axes = figure.subplots(len(lines), 1, squeeze=False, sharex=True, height_ratios=lines)[:, 0]
    for axis, network in zip(axes, results.networks, strict=True):
        grid = np.array(
            [
                [results.macro_f1.get((network, row, column), _NAN) for column in results.tested]
                for row in results.trainings(network)
            ]
        )
        axis.imshow(grid, cmap="Blues", vmin=0.3, vmax=1.0, aspect="auto")
        for (row, column), value in np.ndenumerate(grid):
            axis.text(
                column,
                row,
                number(value, 3),
                ha="center",
                va="center",
                fontsize=8,
                color="white" if value > 0.75 else "black",
            )
        axis.set_yticks(range(len(grid)), results.trainings(network))
        axis.set_ylabel(network)
        axis.spines[:].set_visible(False)
        axis.tick_params(length=0)
    axes[-1].set_xticks(range(len(results.tested)), results.tested, rotation=30, ha="right")
    axes[-1].set_xlabel("tested on")
    return figure


def write_transfer(results: TransferResults, out_folder: Path) -> Path:
    """Write the table and the figure of a study into `tables/` and `figures/` of a folder, made if absent."""
    save_tables({"transfer": transfer_table(results)}, out_folder / "tables")
    save_drawings(encode_figures({"transfer": transfer_figure(results)}), out_folder / "figures")
    return out_folder
