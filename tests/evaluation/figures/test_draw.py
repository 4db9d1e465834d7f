# SPDX-License-Identifier: Apache-2.0
"""Figures of a comparison: present where the data allow, with the numbers they draw, the same bytes each time."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import PathCollection
from PIL import Image

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.figures.draw import COMPARISON_FIGURES, DATASET_FIGURES, draw_figure
from doorstate.evaluation.figures.encode import save_figures
from doorstate.evaluation.figures.errors import common_errors_figure, surest_errors_figure
from doorstate.evaluation.figures.learning import learning_figure
from doorstate.evaluation.figures.poses import errors_figure, poses_figure
from doorstate.evaluation.figures.samples import samples_figure
from doorstate.evaluation.figures.scores import confusion_figure, spread_figure
from doorstate.evaluation.manifest import manifest_frame
from doorstate.evaluation.predictions import load_results
from doorstate.types import STATES
from tests.evaluation.conftest import MakeComparison


def test_imported_data_have_the_figures_that_need_no_pose(
    imported: PreparedDataset, make_comparison: MakeComparison, tmp_path: Path
) -> None:
    results = load_results(make_comparison(imported, {"dgcnn": {"open/3": "closed"}}))
    drawn = {name: draw_figure(results, imported, name) for name in (*DATASET_FIGURES, *COMPARISON_FIGURES)}
    first = {name: png for name, png in drawn.items() if png is not None}
    save_figures(first, tmp_path / "figures")
    assert set(first) == {
        "figure2_samples",
        "figure3_misclassified",
        "confusion",
        "spread",
        "learning_curves",
    }
    assert {path.name for path in (tmp_path / "figures").iterdir()} == {f"{name}.png" for name in first}
    for name, png in first.items():
        assert (tmp_path / "figures" / f"{name}.png").read_bytes() == png
        assert np.ptp(np.asarray(Image.open(io.BytesIO(png)).convert("L"))) > 100
    assert {name: draw_figure(results, imported, name) for name in first} == first


def test_poses_figure_draws_each_pose_once(simulated: PreparedDataset, imported: PreparedDataset) -> None:
    figure = poses_figure(manifest_frame(simulated.rows))
    assert figure is not None
    (axis,) = figure.axes
    assert axis.get_aspect() == 1.0
    dots = [c for c in axis.collections if isinstance(c, PathCollection)]
    drawn = np.concatenate([np.asarray(c.get_offsets()) for c in dots])
    expected = {(float(row["x_m"]), float(row["y_m"])) for row in simulated.rows}
    assert {(x, y) for x, y in drawn.tolist()} == expected
    assert len(drawn) == len(expected) == 40
    assert poses_figure(manifest_frame(imported.rows)) is None


def test_samples_figure_has_picture_and_cloud_of_each_state_and_region(simulated: PreparedDataset) -> None:
    figure = samples_figure(simulated)
    grid = np.array(figure.axes).reshape(2 * len(STATES), 5)
    assert all(axis.images and not axis.collections for axis in grid[::2].ravel())
    assert all(axis.collections and not axis.images for axis in grid[1::2].ravel())
    assert [axis.get_ylabel() for axis in grid[::2, 0]] == ["closed", "semi-open", "open"]


def test_a_missing_sample_is_named(simulated: PreparedDataset) -> None:
    rows = [row for row in simulated.rows if (row["state"], row["region"]) != ("open", "blue")]
    without = PreparedDataset(simulated.folder, simulated.description, rows, simulated.clouds, None)
    texts = [text.get_text() for axis in samples_figure(without).axes for text in axis.texts]
    assert texts == ["no such sample"]


def test_map_of_errors_counts_them(simulated: PreparedDataset, make_comparison: MakeComparison) -> None:
    wrong = {"dgcnn": {simulated.rows[k]["sample_id"]: "closed" for k in (2, 4, 5)}}
    results = load_results(make_comparison(simulated, wrong))
    figure = errors_figure(results)
    assert figure is not None
    titles = [axis.get_title() for axis in figure.axes]
    assert titles == ["pointnet: 0 misclassified", "dgcnn: 3 misclassified"]
    markers = [len(np.asarray(c.get_offsets())) for c in figure.axes[1].collections[1:]]
    assert sum(markers) == 3


def test_figures_of_errors_show_each_method_and_shared_ones(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    poses = [row["pose_id"] for row in simulated.rows[::3]]
    wrong = {
        "dgcnn": {f"{pose}-open": "closed" for pose in poses[3:10]},
        "pointnet": {f"{poses[3]}-open": "semi_open"},
    }
    results = load_results(make_comparison(simulated, wrong))
    surest = surest_errors_figure(results, simulated)
    assert surest is not None
    labels = [axis.get_ylabel().split() for axis in surest.axes if axis.get_ylabel()]
    assert [label[:2] for label in labels] == [["pointnet", "1"], ["dgcnn", "7"]]
    assert sum(bool(axis.get_title()) for axis in surest.axes) == 6, "five of a method at most"
    common = common_errors_figure(results, simulated)
    assert common is not None
    (title,) = [axis.get_title() for axis in common.axes if axis.get_title()]
    assert "pointnet, dgcnn" in title


def test_no_figures_of_errors_without_errors(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    results = load_results(make_comparison(simulated))
    assert errors_figure(results) is None
    assert surest_errors_figure(results, simulated) is None
    assert common_errors_figure(results, simulated) is None


def test_confusion_figure_prints_the_counts(
    imported: PreparedDataset, make_comparison: MakeComparison
) -> None:
    results = load_results(make_comparison(imported, {"dgcnn": {"open/3": "closed"}}))
    texts = [[text.get_text() for text in axis.texts] for axis in confusion_figure(results).axes]
    assert texts[1] == ["20", "0", "0", "0", "20", "0", "1", "0", "19"]


def test_spread_figure_shows_each_finished_fold(
    imported: PreparedDataset, make_comparison: MakeComparison
) -> None:
    results = load_results(make_comparison(imported, missing=[("dgcnn", 0)]))
    axis = spread_figure(results).axes[0]
    assert [len(np.atleast_1d(line.get_xdata())) for line in axis.lines] == [2, 5, 1, 2, 4, 1]


def test_learning_figure_without_logs(imported: PreparedDataset, make_comparison: MakeComparison) -> None:
    folder = make_comparison(imported)
    for log in (folder / "runs" / "pointnet").rglob("log.csv"):
        log.unlink()
    top_left, top_right = learning_figure(load_results(folder)).axes[:2]
    assert [text.get_text() for text in top_left.texts] == ["no log"]
    assert list(top_right.texts) == []
    # Training and validation loss of five folds, and a dot at the selected epoch of each.
    assert len(top_right.lines) == 20
    dots = [line for line in top_right.lines if line.get_linestyle() == "None"]
    assert {float(np.asarray(line.get_xdata())[0]) for line in dots} == {2.0}
    assert top_right.lines[0].get_ydata() == pytest.approx([1, 1 / 2, 1 / 3])
