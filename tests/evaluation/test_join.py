# SPDX-License-Identifier: Apache-2.0
"""Comparisons side by side: of one kind, or refused."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from pandas.testing import assert_frame_equal

from doorstate.dataset.store import PreparedDataset
from doorstate.errors import RunError
from doorstate.evaluation.join import join_results
from doorstate.evaluation.predictions import load_results
from tests.evaluation.conftest import MakeComparison


def _change_comparison(folder: Path, **changes: object) -> None:
    document = json.loads((folder / "comparison.json").read_text()) | changes
    (folder / "comparison.json").write_text(json.dumps(document))


@pytest.fixture
def pair(simulated: PreparedDataset, make_comparison: MakeComparison, tmp_path: Path) -> tuple[Path, Path]:
    """Two comparisons: one of two networks, one of a third, which made an error."""
    wrong = {"pointcnn": {simulated.rows[4]["sample_id"]: "open"}}
    first = make_comparison(simulated).rename(tmp_path / "first")
    return first, make_comparison(simulated, wrong, networks=("pointcnn",), name="second")


def test_joined_methods_stand_side_by_side(pair: tuple[Path, Path]) -> None:
    joined = join_results([load_results(folder) for folder in pair])
    assert joined.config.name == "trial + second"
    assert joined.methods == ("pointnet", "dgcnn", "pointcnn")
    assert len(joined.runs) == 15
    assert joined.errors["method"].tolist() == ["pointcnn"]
    assert joined.missing == ()


def test_one_comparison_joined_is_itself(pair: tuple[Path, Path]) -> None:
    results = load_results(pair[0])
    joined = join_results([results])
    assert joined.config == results.config
    assert_frame_equal(joined.predictions, results.predictions)


def test_folds_that_one_comparison_lacks_are_left_out(pair: tuple[Path, Path]) -> None:
    _change_comparison(pair[1], folds=2)
    joined = join_results([load_results(folder) for folder in pair])
    assert {run.fold for run in joined.runs} == set(joined.predictions["fold"]) == {0, 1}
    assert joined.config.folds == 2


@pytest.mark.parametrize("changes", [{"protocol": "by-pose"}, {"num_points": 512}])
def test_comparisons_of_two_kinds_are_refused(pair: tuple[Path, Path], changes: dict[str, object]) -> None:
    _change_comparison(pair[1], **changes)
    with pytest.raises(RunError) as caught:
        join_results([load_results(folder) for folder in pair])
    assert caught.value.field == next(iter(changes))


def test_comparisons_with_two_splits_are_refused(
    simulated: PreparedDataset, make_comparison: MakeComparison, tmp_path: Path
) -> None:
    first = make_comparison(simulated).rename(tmp_path / "first")
    second = make_comparison(simulated, networks=("pointcnn",), protocol="by-pose")
    _change_comparison(second, protocol="paper")
    with pytest.raises(RunError, match="splits"):
        join_results([load_results(first), load_results(second)])


def test_a_method_is_joined_once(pair: tuple[Path, Path]) -> None:
    with pytest.raises(RunError, match="pointnet"):
        join_results([load_results(pair[0])] * 2)
