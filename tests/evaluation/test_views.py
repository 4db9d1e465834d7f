# SPDX-License-Identifier: Apache-2.0
"""The one oblique view, the colours of points, and legends."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from doorstate.evaluation.views import (
    REGION_COLORS,
    oblique_view,
    outside_legend,
    point_colors,
)
from doorstate.pages.colors import PART_COLORS, STATE_COLORS, VIEW_ELEVATION_RAD
from doorstate.types import STATES, Part

AXES = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], dtype=np.float32)


def test_the_view_is_a_rotation_seen_from_behind_and_above() -> None:
    screen, _ = oblique_view(AXES)
    ahead, left, up = screen
    np.testing.assert_allclose(left, [-1, 0])  # the robot's left is left on the page, and level
    assert up[0] == ahead[0] == 0  # uprights stay upright, and straight ahead leads upwards
    assert up[1] > 0
    assert ahead[1] > 0  # farther floor lies higher on the page: the eye is above
    # Two rows of an orthonormal matrix: what the view shows of the three axes has unit length in each direction.
    np.testing.assert_allclose(screen.T @ screen, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(up[1], np.cos(VIEW_ELEVATION_RAD))


def test_near_points_are_drawn_last() -> None:
    near_to_far = np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]], dtype=np.float32)
    assert oblique_view(near_to_far)[1].tolist() == [2, 1, 0]


def test_points_take_the_colour_of_their_part_or_of_their_height() -> None:
    parts = np.array([Part.LEAF, Part.WALL, Part.LEAF], dtype=np.uint8)
    colors = point_colors(AXES, parts)
    np.testing.assert_allclose(colors[0], to_rgba(PART_COLORS[Part.LEAF]))
    np.testing.assert_allclose(colors[1], to_rgba(PART_COLORS[Part.WALL]))
    by_height = point_colors(AXES, None)
    assert by_height.shape == (3, 4)
    assert (by_height[0] == by_height[1]).all()
    assert (by_height[0] != by_height[2]).any()


def test_every_state_region_and_part_has_its_own_colour() -> None:
    assert tuple(STATE_COLORS) == STATES
    assert set(PART_COLORS) == set(Part)
    for colors in (STATE_COLORS, REGION_COLORS, PART_COLORS):
        assert len(set(colors.values())) == len(colors)


@pytest.mark.parametrize("width_in", [3.1, 4.2, 7.0, 13.8])
@pytest.mark.parametrize(
    "labels",
    [
        ["training", "validation", "selected epoch"],
        ["closed door", "semi-open door", "open door", "hollow: undecidable"],
        ["as trained", "temperature scaled", "fewer than 10 predictions"],
    ],
)
def test_a_legend_is_no_wider_than_its_figure(width_in: float, labels: list[str]) -> None:
    figure = Figure(figsize=(width_in, 3.0), layout="constrained")
    figure.subplots()
    outside_legend(figure, [Line2D([], [], marker="o") for _ in labels], labels, "outside upper right")
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    (legend,) = figure.legends
    extent = legend.get_window_extent(canvas.get_renderer())
    assert extent.x0 >= 0
    assert extent.x1 <= figure.bbox.width
    if width_in > 13:
        assert extent.height < 40, "one line where there is room"
