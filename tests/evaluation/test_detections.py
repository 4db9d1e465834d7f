# SPDX-License-Identifier: Apache-2.0
"""Detections: read, refused, drawn."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from doorstate.dataset.store import PreparedDataset
from doorstate.errors import RunError
from doorstate.evaluation.detections import draw_detections, read_detections
from doorstate.evaluation.figures.errors import surest_errors_figure
from doorstate.evaluation.predictions import load_results
from doorstate.evaluation.views import oblique_view
from doorstate.pages.colors import DETECTION_COLORS
from doorstate.rules.base import Detection
from tests.evaluation.conftest import MakeComparison


def test_no_file_holds_no_detections(tmp_path: Path) -> None:
    assert read_detections(tmp_path / "detections.jsonl") == {}


@pytest.mark.parametrize(
    "line",
    ["{", '{"sample_id": "a"}', '["a"]', '{"sample_id": "a", "detections": [["wall", [[1, 2]]]]}', "3"],
)
def test_a_damaged_line_is_an_error(tmp_path: Path, line: str) -> None:
    path = tmp_path / "detections.jsonl"
    path.write_text('{"sample_id": "b", "detections": []}\n' + line + "\n")
    with pytest.raises(RunError, match="line 2"):
        read_detections(path)


def test_lines_pass_through_the_projected_points() -> None:
    axis = Figure().subplots()
    corners = np.array([[2.0, 1, 0], [2, -1, 0], [2, -1, 1]])
    detections = [("leaf", corners), ("edge", corners[:2]), ("corner", corners[:1])]
    draw_detections(axis, [Detection(name, points) for name, points in detections])
    outline, edge, corner = axis.lines
    screen, _ = oblique_view(corners.astype(np.float32))
    np.testing.assert_allclose(outline.get_xydata(), [*screen, screen[0]])  # closed
    np.testing.assert_allclose(edge.get_xydata(), screen[:2])
    assert (outline.get_color(), corner.get_marker()) == (DETECTION_COLORS["leaf"], "o")


def test_figure_of_errors_draws_detections(
    imported: PreparedDataset, make_comparison: MakeComparison, add_detections: Callable[..., None]
) -> None:
    folder = make_comparison(imported, {"dgcnn": {"open/3": "closed"}, "pointnet": {"open/3": "closed"}})
    add_detections(folder, "dgcnn", "open/3", [["wall", [[2, 1, 0], [2, -1, 0]]]])
    figure = surest_errors_figure(load_results(folder), imported)
    assert figure is not None
    drawn = [len(axis.lines) for axis in figure.axes]
    assert sum(drawn) == 1
    of_dgcnn = figure.axes[10:]  # pointnet's two lines of five come first
    assert sum(len(axis.lines) for axis in of_dgcnn) == 1
