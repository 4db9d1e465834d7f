# SPDX-License-Identifier: Apache-2.0
"""The README's picture: one pose, three states, shaded image above and cloud below.

python tools/readme_picture.py data/ogurob-4096 p0655 docs/images/states.png
"""

from __future__ import annotations

import sys
from pathlib import Path

from matplotlib.figure import Figure

from doorstate.dataset.store import open_dataset
from doorstate.evaluation.samples_figure import draw_cloud
from doorstate.evaluation.views import picture_axes
from doorstate.types import STATES


def main(folder: str, pose: str, target: str) -> None:
    """Draw the pose's three samples."""
    dataset = open_dataset(Path(folder))
    figure = Figure(figsize=(9.6, 4.6), layout="constrained")
    axes = figure.subplots(2, len(STATES), height_ratios=(1.15, 1))
    for axis in axes.ravel():
        picture_axes(axis)
    for column, state in enumerate(STATES):
        index = dataset.index_of(f"{pose}-{state}")
        axes[0, column].imshow(dataset.image(index))
        axes[0, column].set_title(state, fontsize=13)
        draw_cloud(axes[1, column], dataset, index)
    figure.savefig(target, dpi=110)


if __name__ == "__main__":
    main(*sys.argv[1:])
