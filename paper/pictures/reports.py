# SPDX-License-Identifier: Apache-2.0
"""Figures of published comparisons."""

from __future__ import annotations

from collections.abc import Callable

from matplotlib.figure import Figure

from doorstate.evaluation.figures.encode import encode_figure
from doorstate.evaluation.results import Results

from ..published import side_by_side


def draw(experiment: str, name: str, draw_figure: Callable[[Results], Figure | None]) -> bytes:
    """Return one figure of a published comparison as PNG, as in its report.

    Args:
        experiment: name of the comparison.
        name: file of the figure in the report, without its suffix.
        draw_figure: function that draws it.
    """
    figure = draw_figure(side_by_side(experiment))
    assert figure is not None
    return encode_figure(name, figure)
