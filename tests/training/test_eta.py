# SPDX-License-Identifier: Apache-2.0
"""Estimates from finished epochs."""

from __future__ import annotations

from pathlib import Path

import pytest

from doorstate.training.comparison import RunSpec
from doorstate.training.eta import eta_seconds
from doorstate.training.recipes import CoarseStage, Recipe
from doorstate.training.run_folder import RunFolder

RECIPE = Recipe(name="x", epochs=10, coarse_to_fine=(CoarseStage(share=0.5, points=256),))
RECIPES = {"pointnet": RECIPE, "dgcnn": RECIPE}


def test_unfinished_epochs_take_as_long_as_finished_ones_in_proportion_to_points(tmp_path: Path) -> None:
    finished, started = RunFolder(tmp_path / "finished"), RunFolder(tmp_path / "started")
    points = [256] * 5 + [512] * 5
    finished.write_log(
        [{"epoch": n, "points": p, "centres": 1, "seconds": p / 16} for n, p in enumerate(points)]
    )
    finished.finish({})
    started.write_log([{"epoch": n, "points": 256, "centres": 1, "seconds": 30.0} for n in range(2)])
    started.write_position(2.5)
    runs = [
        RunSpec("pointnet", 0, finished),
        RunSpec("pointnet", 1, RunFolder(tmp_path / "new")),
        RunSpec("dgcnn", 0, started),
        RunSpec("plane_state", 0, RunFolder(tmp_path / "rule")),
    ]
    pointnet = 5 * 16 + 5 * 32
    dgcnn = 2.5 * 30 + 5 * 60  # no epoch of 512 points is finished
    assert eta_seconds(runs, RECIPES, 512) == pytest.approx(pointnet + dgcnn)


def test_no_estimate_before_the_first_epoch(tmp_path: Path) -> None:
    assert eta_seconds([RunSpec("dgcnn", 0, RunFolder(tmp_path))], RECIPES, 512) is None
