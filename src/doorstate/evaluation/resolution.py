# SPDX-License-Identifier: Apache-2.0
"""Resolution study: macro F1 against the number of points, and the time that each number takes."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd

from doorstate.errors import RunError
from doorstate.evaluation.figures.encode import encode_figure, save_figures
from doorstate.evaluation.figures.resolution import resolution_figure
from doorstate.evaluation.metrics import macro_f1
from doorstate.evaluation.study import StudyResults
from doorstate.evaluation.table import Table, count_column, label_column, number_column
from doorstate.evaluation.tables import save_tables
from doorstate.training.run_folder import AS_TRAINED, FINE_TUNED

_COLUMNS = {AS_TRAINED: "as_trained", FINE_TUNED: "fine_tuned"}


def score_resolution(study: StudyResults) -> pd.DataFrame:
    """Score every network and number of points of a study.

    Networks that have not finished all folds of a part are left out of it.

    Returns:
        Columns method, points, as_trained and fine_tuned (macro F1, NaN where there is none), milliseconds (median from
        a raw cloud to a state), in the order of the study's networks.

    Raises:
        RunError: the study has no finished part.
    """
    scores: dict[tuple[str, int], dict[str, float]] = {}
    methods: dict[str, None] = {}
    for name in sorted(study.parts):
        kind, _, points = name.rpartition("-")
        if kind not in _COLUMNS:
            continue
        results = study.parts[name]
        partial = {method for method, _ in results.missing}
        for method in results.methods:
            if method not in partial:
                methods[method] = None
                cell = scores.setdefault((method, int(points)), {})
                cell[_COLUMNS[kind]] = macro_f1(results.tested_by(method))
    if not scores:
        raise RunError("holds no finished part of a resolution study", field="parts")
    all_points = sorted({points for _, points in scores})
    rows = [
        {
            "method": method,
            "points": points,
            "milliseconds": study.latencies_ms.get((method, points), math.nan),
        }
        | scores.get((method, points), {})
        for method in methods
        for points in all_points
    ]
    return pd.DataFrame(rows, columns=["method", "points", *_COLUMNS.values(), "milliseconds"]).astype(
        dict.fromkeys(_COLUMNS.values(), "float64")
    )


def fewest_points(
    scores: pd.DataFrame, method: str, fewest: int, trained: int, tolerance: float
) -> int | None:
    """Return the fewest points with which weights do as well as with those of their training, and with all between.

    Args:
        scores: output of `score_resolution`.
        method: name of the network.
        fewest: lower bound of the result.
        trained: number of points the weights were trained with; more are not considered.
        tolerance: loss of macro F1 that counts as doing as well.

    Returns:
        None if the study does not have the network with at most `trained` points.
    """
    own = scores[(scores["method"] == method) & (scores["points"] <= trained) & scores["as_trained"].notna()]
    own = own.sort_values("points", ascending=False)
    enough = None
    for points, f1 in zip(own["points"], own["as_trained"], strict=True):
        if f1 < own["as_trained"].iloc[0] - tolerance:
            break
        if enough is None or points >= fewest:
            enough = int(points)
    return enough


def resolution_table(scores: pd.DataFrame) -> Table:
    """Build the table of `score_resolution`; a column for fine-tuned weights only if there are some."""
    tuned = bool(np.isfinite(scores["fine_tuned"]).any())
    columns = (
        label_column("method"),
        count_column("points"),
        number_column("as_trained", "macro F1, as trained"),
        *([number_column("fine_tuned", "macro F1, fine-tuned")] if tuned else []),
        number_column("milliseconds", "ms from cloud to state", 1),
    )
    note = "Fine-tuned: the same weights trained a little more with that number of points. " if tuned else ""
    return Table.from_frame(
        "Accuracy and time by number of points",
        scores,
        columns,
        "As trained: finished weights given that number of points of each cloud, whatever number they were trained "
        f"with. {note}Milliseconds: median from a raw 640 × 480 cloud in memory to the state, float32.",
    )


def write_resolution(study: StudyResults, out: Path) -> Path:
    """Write the table and the figure of a study into `tables/` and `figures/` of a folder, made if absent."""
    scores = score_resolution(study)
    save_tables({"resolution": resolution_table(scores)}, out / "tables")
    save_figures({"resolution": encode_figure("resolution", resolution_figure(scores))}, out / "figures")
    return out
