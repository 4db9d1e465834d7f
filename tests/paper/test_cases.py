# SPDX-License-Identifier: Apache-2.0
"""Accuracy by case, and methods compared with a rule, on errors that the test puts in."""

from __future__ import annotations

from paper.pages.cases import (
    PAPER_CASES,
    accuracy_by_case,
    compare_with_rule,
    count_error_kinds,
    near_border,
)

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.predictions import load_results
from tests.evaluation.conftest import MakeComparison


def samples_of(dataset: PreparedDataset, state: str) -> list[str]:
    return [row["sample_id"] for row in dataset.rows if row["state"] == state]


def test_a_rule_and_a_network_are_compared_by_what_only_one_gets_right(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    first, second, third, fourth = samples_of(simulated, "open")[:4]
    wrong = {
        "dgcnn": {first: "abstained", second: "closed", third: "closed"},  # stands for a rule
        "pointnet": {third: "semi_open", fourth: "semi_open"},
    }
    results = load_results(make_comparison(simulated, wrong))
    (row,) = compare_with_rule(results, "dgcnn", ["pointnet"]).to_dict("records")
    assert row == {"method": "pointnet", "only_rule": 1, "only_network": 2, "abstained": 1}


def test_cases_are_shares_of_the_samples_that_belong_to_them(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    closed = samples_of(simulated, "closed")
    results = load_results(make_comparison(simulated, {"pointnet": {closed[0]: "open"}}))
    frame = accuracy_by_case(results, ("pointnet", "dgcnn"), PAPER_CASES).set_index("case")
    assert frame.loc["closed"].tolist() == [40, 39 / 40, 1.0]
    assert frame.loc["open"].tolist() == [40, 1.0, 1.0]
    angles = [float(row["opening_angle_deg"]) for row in simulated.rows]
    near = sum(min(abs(angle - border) for border in (15, 65, 75)) <= 5 for angle in angles)
    assert 0 < near < len(angles)
    assert frame.loc["opening within 5° of another state", "samples"] == near


def test_errors_are_counted_by_what_they_have_in_common(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    results = load_results(make_comparison(simulated))
    rows = results.tested_by("pointnet")
    border, close = near_border(rows), rows["distance_m"] < 2

    def first(state: str, is_border: bool, is_close: bool) -> str:
        chosen = rows[(rows["state"] == state) & (border == is_border) & (close == is_close)]
        return str(chosen["sample_id"].iloc[0])

    wrong = {
        "pointnet": {first("open", True, False): "semi_open", first("open", False, True): "semi_open"},
        "dgcnn": {first("semi_open", False, False): "open"},
    }
    assert count_error_kinds(results) == (0, 0, 0)
    assert count_error_kinds(load_results(make_comparison(simulated, wrong))) == (3, 1, 1)
