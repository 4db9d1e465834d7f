# SPDX-License-Identifier: Apache-2.0
"""Transfer study: macro F1 of weights trained on one data set and tested on another."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from doorstate.errors import RunError
from doorstate.evaluation.figures.encode import encode_figure, save_figures
from doorstate.evaluation.figures.transfer import transfer_figure
from doorstate.evaluation.metrics import macro_f1
from doorstate.evaluation.study import StudyResults
from doorstate.evaluation.table import Table, label_column, number_column
from doorstate.evaluation.tables import save_tables


def score_transfer(study: StudyResults, trained: Sequence[str], tested: Sequence[str]) -> pd.DataFrame:
    """Score every pair of a study that is finished.

    Args:
        study: results with parts `<trained>/<tested>`.
        trained: names of trainings, in the order of rows.
        tested: names of tested data sets, in the order of columns.

    Returns:
        Columns method, trained, tested (ordered categories), samples (with a door), f1 (macro).

    Raises:
        RunError: no pair is finished.
    """
    rows = []
    for row in trained:
        for column in tested:
            results = study.parts.get(f"{row}/{column}")
            if results is None:
                continue
            for method in results.methods:
                predictions = results.tested_by(method)
                rows.append((method, row, column, len(predictions), macro_f1(predictions)))
    if not rows:
        raise RunError("holds no finished part of a transfer study", field="parts")
    frame = pd.DataFrame(rows, columns=["method", "trained", "tested", "samples", "f1"])
    methods = list(dict.fromkeys(frame["method"]))
    for name, order in (("method", methods), ("trained", list(trained)), ("tested", list(tested))):
        frame[name] = pd.Categorical(frame[name], order, ordered=True)
    return frame


def transfer_grid(scores: pd.DataFrame) -> pd.DataFrame:
    """Lay out `score_transfer` as a grid: a row for each method and training, a column for each tested data set."""
    grid = scores.pivot(index=["method", "trained"], columns="tested", values="f1")
    grid = grid.reindex(columns=list(scores["tested"].cat.categories)).sort_index()
    return grid.rename_axis(columns=None).reset_index()


def transfer_table(scores: pd.DataFrame) -> Table:
    """Build the table of `score_transfer`."""
    samples = scores.groupby("tested", observed=True)["samples"].last()
    counts = ", ".join(f"{name} {count}" for name, count in samples.items())
    return Table.from_frame(
        "Macro F1 by what was trained on and what was tested on",
        transfer_grid(scores),
        (
            label_column("method"),
            label_column("trained", "trained on"),
            *(number_column(str(name)) for name in scores["tested"].cat.categories),
        ),
        "A column tests the same samples with all weights; none of the trainings has seen their scenes. Samples with "
        f"a door: {counts}.",
    )


def write_transfer(scores: pd.DataFrame, out: Path) -> Path:
    """Write the table and the figure of a study into `tables/` and `figures/` of a folder, made if absent."""
    save_tables({"transfer": transfer_table(scores)}, out / "tables")
    figure = transfer_figure(transfer_grid(scores))
    save_figures({"transfer": encode_figure("transfer", figure)}, out / "figures")
    return out
