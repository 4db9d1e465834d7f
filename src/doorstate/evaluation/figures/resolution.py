# SPDX-License-Identifier: Apache-2.0
"""Figure of a resolution study."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from doorstate.evaluation.views import NETWORK_COLORS, graph_axes

_FRAME_MS = 1000 / 30


def resolution_figure(scores: pd.DataFrame) -> Figure:
    """Draw macro F1 against points, and against milliseconds.

    Args:
        scores: output of `resolution.score_resolution`.
    """
    figure = Figure(figsize=(9.6, 3.9), layout="constrained")
    by_points, by_time = figure.subplots(1, 2, sharey=True)
    measured = scores.dropna(subset="as_trained")
    measured = measured.assign(best=measured["fine_tuned"].fillna(measured["as_trained"]))
    for method, rows in measured.groupby("method", sort=False):
        style = {"color": NETWORK_COLORS.get(str(method), "#333333"), "markersize": 4}
        by_points.plot(
            rows["points"], rows["as_trained"], "o:", markerfacecolor="none", linewidth=1.0, **style
        )
        by_points.plot(rows["points"], rows["best"], "o-", linewidth=1.4, label=method, **style)
        timed = rows.dropna(subset="milliseconds")
        by_time.plot(timed["milliseconds"], timed["best"], "o-", linewidth=1.4, **style)
    by_points.set_xscale("log", base=2)
    dotted = " (dotted: as trained, without fine-tuning)" if scores["fine_tuned"].notna().any() else ""
    by_points.set(xlabel=f"points{dotted}", ylabel="macro F1")
    points = sorted(scores["points"].unique())
    by_points.set_xticks(points, [str(count) for count in points], minor=False)
    by_time.set(xlabel="ms from raw cloud to state")
    by_time.axvline(_FRAME_MS, color="#999999", linewidth=0.8, linestyle="--")
    by_time.annotate(
        "one frame at 30 Hz",
        (_FRAME_MS, 0.02),
        xycoords=("data", "axes fraction"),
        fontsize=8,
        color="#666666",
        xytext=(4, 0),
        textcoords="offset points",
    )
    for axis in (by_points, by_time):
        graph_axes(axis)
    by_points.legend(frameon=False, fontsize=8)
    return figure
