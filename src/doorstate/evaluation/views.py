# SPDX-License-Identifier: Apache-2.0
"""Colours of regions and networks, the oblique view of clouds, and the style of axes, in every figure."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.colors import Normalize, to_rgba_array
from numpy.typing import NDArray

from doorstate.pages.colors import PART_COLORS, VIEW_ELEVATION_RAD
from doorstate.types import Part, Points

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe & Ito's colour-blind-safe set, with a deeper red to fit the paper's name of the region.
REGION_COLORS = {
    "orange": "#E69F00",
    "red": "#B3202C",
    "green": "#009E73",
    "yellow": "#F0E442",
    "blue": "#0072B2",
}
NETWORK_COLORS = {
    "pointnet": "#0072B2",
    "pointnet2": "#D55E00",
    "dgcnn": "#009E73",
    "pointcnn": "#CC79A7",
    "point2sequence": "#E69F00",
}

# Widths in a legend with matplotlib's default font size: a letter, and a mark with its margins.
_LETTER_IN, _MARK_IN = 0.076, 0.62


def outside_legend(
    figure: Figure,
    handles: Sequence[Artist],
    labels: Sequence[str],
    place: Literal["outside upper right", "outside lower center"],
) -> None:
    """Add a legend outside the axes, in as many columns as the figure has room for.

    Args:
        figure: figure with constrained layout.
        handles: artists, one for each label.
        labels: texts in the default font size.
        place: location of the legend in matplotlib.
    """
    column_in = _LETTER_IN * max(map(len, labels)) + _MARK_IN
    columns = min(len(labels), max(1, int(figure.get_figwidth() / column_in)))
    figure.legend(list(handles), list(labels), loc=place, ncols=columns, frameon=False)


def oblique_view(points: Points) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Project a cloud as seen from behind and above the sensor, without perspective.

    Args:
        points: (N, 3) metres, sensor frame.

    Returns:
        (N, 2) metres to the right and up, and the (N,) order in which near points are drawn last.
    """
    down, level = math.sin(VIEW_ELEVATION_RAD), math.cos(VIEW_ELEVATION_RAD)
    x, y, z = points.astype(np.float64).T
    screen = np.stack([-y, down * x + level * z], axis=1)
    return screen, np.argsort(down * z - level * x, kind="stable")


def point_colors(points: Points, parts: NDArray[np.uint8] | None) -> NDArray[np.float64]:
    """Colour each point by its part, or by its height where parts are unknown.

    Args:
        points: (N, 3) metres.
        parts: (N,) values of `Part`, or None.

    Returns:
        (N, 4) red, green, blue and opacity, 0 to 1.
    """
    if parts is None:
        height = Normalize()(points[:, 2].astype(np.float64))
        return np.asarray(mpl.colormaps["viridis"](height))
    palette = to_rgba_array([PART_COLORS[Part(part)] for part in np.unique(parts)])
    return np.asarray(palette[np.unique(parts, return_inverse=True)[1]])


def graph_axes(axis: Axes, grid: Literal["both", "x", "y"] = "both") -> None:
    """Give a graph a faint grid and no frame above and to the right."""
    axis.grid(axis=grid, alpha=0.25)
    axis.spines[["top", "right"]].set_visible(False)


def picture_axes(axis: Axes) -> None:
    """Give a picture neither ticks nor frame."""
    axis.set(xticks=[], yticks=[])
    axis.spines[:].set_visible(False)
