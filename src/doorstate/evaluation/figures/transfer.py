# SPDX-License-Identifier: Apache-2.0
"""Figure of a transfer study."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from doorstate.evaluation.table import number


def transfer_figure(grid: pd.DataFrame) -> Figure:
    """Draw a grid of macro F1 for each method, darker cells for larger values.

    Args:
        grid: output of `transfer.transfer_grid`.
    """
    groups = list(grid.groupby("method", sort=False, observed=True))
    tested = [name for name in grid if name not in ("method", "trained")]
    lines = [len(rows) for _, rows in groups]
    size = 0.75 * len(tested) + 1.6, 0.36 * sum(lines) + 0.5 * len(lines) + 0.9
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(len(lines), 1, squeeze=False, sharex=True, height_ratios=lines)[:, 0]
    for axis, (method, rows) in zip(axes, groups, strict=True):
        values = rows[tested].to_numpy(dtype=np.float64)
        axis.imshow(values, cmap="Blues", vmin=0.3, vmax=1.0, aspect="auto")
        for (line, column), value in np.ndenumerate(values):
            color = "white" if value > 0.75 else "black"
            axis.text(column, line, number(value, 3), ha="center", va="center", fontsize=8, color=color)
        axis.set_yticks(range(len(values)), rows["trained"])
        axis.set_ylabel(method)
        axis.spines[:].set_visible(False)
        axis.tick_params(length=0)
    axes[-1].set_xticks(range(len(tested)), tested, rotation=30, ha="right")
    axes[-1].set_xlabel("tested on")
    return figure
