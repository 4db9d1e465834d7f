# SPDX-License-Identifier: Apache-2.0
"""Three states of one pose: shaded images above, clouds below."""

from __future__ import annotations

from io import BytesIO

from matplotlib.figure import Figure

from doorstate.dataset.store import open_dataset
from doorstate.evaluation.figures.samples import draw_cloud, part_legend
from doorstate.evaluation.views import picture_axes
from doorstate.pages.colors import STATE_WORDS
from doorstate.types import STATES

from .. import paths

POSE = "p1250"


def draw() -> bytes:
    """Return the picture as PNG."""
    dataset = open_dataset(paths.RESULTS / "datasets" / "ogurob-4096")
    figure = Figure(figsize=(9.6, 4.9), layout="constrained")
    axes = figure.subplots(2, len(STATES), height_ratios=(1.15, 1), sharex="row", sharey="row")
    for axis in axes.ravel():
        picture_axes(axis)
    indices = [dataset.index_of(f"{POSE}-{state}") for state in STATES]
    for column, index in enumerate(indices):
        axes[0, column].imshow(dataset.image(index))
        axes[0, column].set_title(STATE_WORDS[STATES[column]], fontsize=13)
        draw_cloud(axes[1, column], dataset, index)
    part_legend(figure, dataset, indices)
    png = BytesIO()
    figure.savefig(png, dpi=110)
    return png.getvalue()
