# SPDX-License-Identifier: Apache-2.0
"""Comparisons side by side: like with like, or not at all."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from doorstate.dataset.store import PreparedDataset
from doorstate.errors import RunError
from doorstate.evaluation.join import load_joined
from doorstate.evaluation.results import load_results

MakeComparison = Callable[..., Path]


@pytest.fixture
def pair(simulated: PreparedDataset, make_comparison: MakeComparison, tmp_path: Path) -> tuple[Path, Path]:
    """Two comparisons, one of two networks and one of a third, which made an error."""
    wrong = {"pointcnn": {simulated.rows[4]["sample_id"]: "open"}}
    first = make_comparison(simulated).rename(tmp_path / "first")
    return first, make_comparison(simulated, wrong, networks=("pointcnn",), name="other")


def change(folder: Path, **changes: object) -> None:
    path = folder / "comparison.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def test_methods_stand_side_by_side(pair: tuple[Path, Path]) -> None:
    joined = load_joined(pair)
    assert joined.comparison.name == "trial + other"
    assert joined.networks == ("pointnet", "dgcnn", "pointcnn")
    assert len(joined.runs) == 15
    assert [error.network for error in joined.error_rows] == ["pointcnn"]
    assert joined.missing == ()


def test_one_comparison_is_itself(pair: tuple[Path, Path]) -> None:
    joined, alone = load_joined(pair[:1]), load_results(pair[0])
    assert (joined.comparison, len(joined.runs)) == (alone.comparison, len(alone.runs))


def test_folds_that_one_lacks_are_left_out(pair: tuple[Path, Path]) -> None:
    change(pair[1], folds=2)
    joined = load_joined(pair)
    assert {run.fold for run in joined.runs} == {0, 1}
    assert joined.comparison.folds == 2


@pytest.mark.parametrize(
    ("changes", "message"),
    [({"protocol": "by-pose"}, "another protocol"), ({"num_points": 512}, "another num_points")],
)
def test_unlike_comparisons_are_refused(
    pair: tuple[Path, Path], changes: dict[str, object], message: str
) -> None:
    change(pair[1], **changes)
    with pytest.raises(RunError, match=message):
        load_joined(pair)


def test_other_folds_are_refused(
    simulated: PreparedDataset, make_comparison: MakeComparison, tmp_path: Path
) -> None:
    first = make_comparison(simulated).rename(tmp_path / "first")
    second = make_comparison(simulated, networks=("pointcnn",), protocol="by-pose")
    change(second, protocol="paper")
    with pytest.raises(RunError, match="other folds"):
        load_joined([first, second])


def test_a_method_is_not_counted_twice(pair: tuple[Path, Path]) -> None:
    with pytest.raises(RunError, match="pointnet is in two of these"):
        load_joined([pair[0], pair[0]])
