# SPDX-License-Identifier: Apache-2.0
"""A resolution study's table against errors that the test puts in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from doorstate._files import write_csv
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import RunError
from doorstate.evaluation.resolution import (
    LATENCY,
    ResolutionResults,
    fewest_points,
    load_resolution,
    resolution_table,
    write_resolution,
)
from doorstate.evaluation.table import UNDEFINED

from .conftest import MakeComparison


@pytest.fixture
def study(simulated: PreparedDataset, make_comparison: MakeComparison, tmp_path: Path) -> Callable[..., Path]:
    """Add a part of the study in which so many open doors are called closed."""
    opened = [row["sample_id"] for row in simulated.rows if row["state"] == "open"]

    def add(name: str, errors: int, missing: Sequence[tuple[str, int]] = ()) -> Path:
        wrong = {"pointnet": dict.fromkeys(opened[:errors], "closed")}
        folder = tmp_path / "study" / name
        folder.parent.mkdir(exist_ok=True)
        make_comparison(simulated, wrong, ("pointnet",), missing).rename(folder)
        return folder.parent

    return add


def test_each_kind_of_weights_has_its_column(study: Callable[..., Path], tmp_path: Path) -> None:
    study("as-trained-128", 4)
    folder = study("as-trained-256", 0)
    table = resolution_table(load_resolution(folder))
    assert table.columns == ("network", "points", "macro F1, as trained", "ms from cloud to answer")
    coarse = float(table.rows[0][2])
    assert table.rows == (
        ("pointnet", "128", f"{coarse:.4f}", UNDEFINED),
        ("pointnet", "256", "1.0000", UNDEFINED),
    )
    study("fine-tuned-128", 2)
    write_csv(folder / LATENCY, [{"network": "pointnet", "points": "256", "median_ms": "7.25"}])
    results = load_resolution(folder)
    coarse_row, fine_row = resolution_table(results).rows
    assert coarse < float(coarse_row[3]) < 1
    assert fine_row == ("pointnet", "256", "1.0000", UNDEFINED, "7.2")
    assert results.best("pointnet", 128) == pytest.approx(float(coarse_row[3]), abs=1e-4)
    assert results.best("pointnet", 256) == 1
    out = write_resolution(folder, tmp_path / "report")
    assert (out / "tables" / "resolution.md").is_file()
    assert (out / "figures" / "resolution.svg").is_file()


def test_a_study_without_a_finished_part_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="holds no finished part"):
        load_resolution(tmp_path)


def test_a_part_counts_once_all_its_folds_are_there(study: Callable[..., Path]) -> None:
    study("as-trained-128", 0)
    folder = study("fine-tuned-128", 4, [("pointnet", 4)])
    assert load_resolution(folder).fine_tuned == {}


@pytest.mark.parametrize(
    ("macro_f1", "enough"),
    [
        ({256: 0.90, 512: 0.90, 1024: 0.90, 4096: 0.90}, 512),
        ({256: 0.90, 512: 0.899, 1024: 0.901, 4096: 0.90}, 512),
        ({256: 0.90, 512: 0.80, 1024: 0.90, 4096: 0.90}, 1024),
        ({256: 0.90, 512: 0.90, 1024: 0.80, 4096: 0.90}, 4096),
        ({128: 0.90, 256: 0.90}, 256),
        ({}, None),
    ],
)
def test_the_fewest_points_that_lose_nothing(macro_f1: dict[int, float], enough: int | None) -> None:
    found = {("dgcnn", points): value for points, value in macro_f1.items()}
    results = ResolutionResults(("dgcnn",), tuple(macro_f1), found, {}, {})
    assert fewest_points(results, "dgcnn", fewest=512, trained=4096, lost=0.002) == enough
    assert fewest_points(results, "pointnet", fewest=512, trained=4096, lost=0.002) is None


def test_more_points_than_weights_were_trained_with_are_no_default() -> None:
    found = {("dgcnn", 512): 0.88, ("dgcnn", 1024): 0.90, ("dgcnn", 4096): 0.95}
    results = ResolutionResults(("dgcnn",), (512, 1024, 4096), found, {}, {})
    assert fewest_points(results, "dgcnn", fewest=512, trained=1024, lost=0.002) == 1024
