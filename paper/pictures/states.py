# SPDX-License-Identifier: Apache-2.0
"""The README's picture: one pose, three states, shaded image above and cloud below.

python tools/readme_picture.py results/ogurob-4096 p1250 docs/images/states.png
"""

from __future__ import annotations

import sys
from pathlib import Path

from matplotlib.figure import Figure

from doorstate.dataset.store import open_dataset
from doorstate.evaluation.samples_figure import draw_cloud, part_legend
from doorstate.evaluation.views import STATE_WORDS, picture_axes
from doorstate.types import STATES


def main(folder: str, pose: str, target: str) -> None:
    """Draw the pose's three samples."""
    dataset = open_dataset(Path(folder))
    figure = Figure(figsize=(9.6, 4.9), layout="constrained")
    axes = figure.subplots(2, len(STATES), height_ratios=(1.15, 1), sharex="row", sharey="row")
    for axis in axes.ravel():
        picture_axes(axis)
    indices = [dataset.index_of(f"{pose}-{state}") for state in STATES]
    for column, index in enumerate(indices):
        axes[0, column].imshow(dataset.image(index))
        axes[0, column].set_title(STATE_WORDS[STATES[column]], fontsize=13)
        draw_cloud(axes[1, column], dataset, index)
    part_legend(figure, dataset, indices)
    figure.savefig(target, dpi=110)


if __name__ == "__main__":
    main(*sys.argv[1:])
