# SPDX-License-Identifier: Apache-2.0
"""Scores of a resolution study against errors that the test puts in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from doorstate._files import write_csv
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import RunError
from doorstate.evaluation.resolution import (
    fewest_points,
    resolution_table,
    score_resolution,
    write_resolution,
)
from doorstate.evaluation.study import LATENCY, StudyResults, load_study_results
from tests.evaluation.conftest import MakeComparison


@pytest.fixture
def add_part(
    simulated: PreparedDataset, make_comparison: MakeComparison, tmp_path: Path
) -> Callable[..., Path]:
    """Add a part to a study in which a number of open doors are predicted closed."""
    opened = [row["sample_id"] for row in simulated.rows if row["state"] == "open"]

    def add(name: str, errors: int, missing: Sequence[tuple[str, int]] = ()) -> Path:
        wrong = {"pointnet": dict.fromkeys(opened[:errors], "closed")}
        folder = tmp_path / "study" / name
        folder.parent.mkdir(exist_ok=True)
        make_comparison(simulated, wrong, ("pointnet",), missing).rename(folder)
        return folder.parent

    return add


def test_each_kind_of_weights_has_its_column(add_part: Callable[..., Path], tmp_path: Path) -> None:
    add_part("as-trained-128", 4)
    folder = add_part("as-trained-256", 0)
    scores = score_resolution(load_study_results(folder))
    assert scores["points"].tolist() == [128, 256]
    assert scores["as_trained"][0] < scores["as_trained"][1] == 1
    assert scores[["fine_tuned", "milliseconds"]].isna().all(axis=None)
    assert len(resolution_table(scores).columns) == 4
    add_part("fine-tuned-128", 2)
    write_csv(folder / LATENCY, [{"network": "pointnet", "points": "256", "median_ms": "7.25"}])
    study = load_study_results(folder)
    coarse, fine = score_resolution(study).to_dict("records")
    assert coarse["as_trained"] < coarse["fine_tuned"] < 1
    assert np.isnan(fine["fine_tuned"])
    assert fine["milliseconds"] == 7.25
    assert len(resolution_table(score_resolution(study)).columns) == 5
    out = write_resolution(study, tmp_path / "report")
    assert pd.read_csv(out / "tables" / "resolution.csv")["points"].tolist() == [128, 256]
    assert (out / "figures" / "resolution.png").is_file()


def test_a_study_without_a_finished_part_is_refused() -> None:
    with pytest.raises(RunError):
        score_resolution(StudyResults({}))


def test_a_part_counts_once_all_its_folds_are_finished(add_part: Callable[..., Path]) -> None:
    add_part("as-trained-128", 0)
    folder = add_part("fine-tuned-128", 4, [("pointnet", 4)])
    assert score_resolution(load_study_results(folder))["fine_tuned"].isna().all()


@pytest.mark.parametrize(
    ("macro_f1", "trained", "enough"),
    [
        ({256: 0.90, 512: 0.90, 1024: 0.90, 4096: 0.90}, 4096, 512),
        ({256: 0.90, 512: 0.899, 1024: 0.901, 4096: 0.90}, 4096, 512),
        ({256: 0.90, 512: 0.80, 1024: 0.90, 4096: 0.90}, 4096, 1024),
        ({256: 0.90, 512: 0.90, 1024: 0.80, 4096: 0.90}, 4096, 4096),
        ({128: 0.90, 256: 0.90}, 4096, 256),
        ({512: 0.88, 1024: 0.90, 4096: 0.95}, 1024, 1024),  # more points than in training are no choice
        ({}, 4096, None),
    ],
)
def test_fewest_points_without_loss(macro_f1: dict[int, float], trained: int, enough: int | None) -> None:
    scores = pd.DataFrame(
        {"method": "dgcnn", "points": list(macro_f1), "as_trained": list(macro_f1.values())}
    )
    assert fewest_points(scores, "dgcnn", fewest=512, trained=trained, tolerance=0.002) == enough
    assert fewest_points(scores, "pointnet", fewest=512, trained=trained, tolerance=0.002) is None
