# SPDX-License-Identifier: Apache-2.0
"""Rules against networks on errors that the test puts in; any method may stand for a rule."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import pytest

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.results import load_results
from tests.evaluation.conftest import MakeComparison


@pytest.fixture
def duels(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    from paper.pages import pairwise

    return pairwise


def samples_of(dataset: PreparedDataset, state: str) -> list[str]:
    return [row["sample_id"] for row in dataset.rows if row["state"] == state]


def test_a_duel_counts_what_only_one_has_right(
    duels: ModuleType, simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    first, second, third, fourth = samples_of(simulated, "open")[:4]
    wrong = {
        "dgcnn": {first: "abstained", second: "closed", third: "closed"},  # the rule
        "pointnet": {third: "semi_open", fourth: "semi_open"},
    }
    results = load_results(make_comparison(simulated, wrong))
    table = duels.duels_table(results, ["dgcnn"], ["pointnet"])
    # The network alone misses the fourth; the rule alone the first and second, the first without a word.
    assert table.rows == (("dgcnn", "pointnet", "1", "2", "1"),)


def test_cases_are_shares_of_the_samples_that_belong_to_them(
    duels: ModuleType, simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    rows = {row["sample_id"]: row | {"visible_leaf_px": "20000"} for row in simulated.rows}
    small = samples_of(simulated, "closed")[:4]
    for sample in small:
        rows[sample]["visible_leaf_px"] = "9999"
    results = load_results(make_comparison(simulated, {"pointnet": {small[0]: "open"}}))
    lines = {line[0]: line[1:] for line in duels.cases_table(results, rows, ("pointnet", "dgcnn")).rows}
    assert lines["leaf below 10000 pixels"] == ("4", "0.7500", "1.0000")
    assert lines["closed"] == ("40", "0.9750", "1.0000")
    assert lines["open"] == ("40", "1.0000", "1.0000")
    near = sum(
        min(abs(float(row["opening_angle_deg"]) - border) for border in (15, 65, 75)) <= 5
        for row in simulated.rows
    )
    assert 0 < near < len(rows)
    assert lines["opening within 5° of another state"][0] == str(near)


def test_never_seen_are_the_samples_that_the_honest_protocol_tested(
    duels: ModuleType, simulated: PreparedDataset, make_comparison: MakeComparison, tmp_path: Path
) -> None:
    closed = samples_of(simulated, "closed")
    wrong = {"dgcnn": dict.fromkeys(closed[:2], "open")}
    paper = load_results(make_comparison(simulated, wrong).rename(tmp_path / "paper"))
    by_pose = load_results(
        make_comparison(
            simulated,
            {"pointnet": {closed[5]: "open"}},
            ("pointnet",),
            missing=[("pointnet", fold) for fold in (1, 2, 3, 4)],
        )
    )
    tested = set(by_pose.pooled("pointnet").sample_ids)
    errors = {"pointnet": len({closed[5]} & tested), "dgcnn": len(set(closed[:2]) & tested)}
    lines = {line[0]: line for line in duels.never_seen_table(paper, by_pose, ["dgcnn"]).rows}
    assert 0 < len(tested) < len(simulated)
    for method, count in errors.items():
        assert lines[method][2] == f"{count} of {len(tested)}"
        assert (lines[method][1] == "1.0000") is (count == 0)
