# SPDX-License-Identifier: Apache-2.0
"""Paired tests against hand-worked numbers."""

from __future__ import annotations

import pytest
from statsmodels.stats.multitest import multipletests

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.pairwise import correct_by_method, mcnemar_p, pairwise_tests
from doorstate.evaluation.predictions import load_results
from tests.evaluation.conftest import MakeComparison


def test_mcnemar_by_hand() -> None:
    assert mcnemar_p(8, 2) == pytest.approx(2 * (1 + 10 + 45) / 2**10)
    assert mcnemar_p(2, 8) == pytest.approx(mcnemar_p(8, 2))
    assert mcnemar_p(0, 0) == mcnemar_p(3, 3) == 1.0


def test_holm_correction_is_over_all_pairs(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    ids = [row["sample_id"] for row in simulated.rows]
    wrong = {
        "pointnet": dict.fromkeys(ids[0:30:3], "open"),
        "dgcnn": dict.fromkeys(ids[30:33:3], "open"),
    }
    tests = pairwise_tests(
        load_results(make_comparison(simulated, wrong, networks=("pointnet", "dgcnn", "pointcnn")))
    )
    assert list(zip(tests["first"], tests["second"], strict=True)) == [
        ("pointnet", "dgcnn"),
        ("pointnet", "pointcnn"),
        ("dgcnn", "pointcnn"),
    ]
    assert tests["samples"].tolist() == [120] * 3
    assert tests["only_first_correct"].tolist() == [1, 0, 0]
    assert tests["only_second_correct"].tolist() == [10, 10, 1]
    assert tests["p"].tolist() == [mcnemar_p(1, 10), mcnemar_p(0, 10), mcnemar_p(0, 1)]
    smallest = tests["p"].min()
    assert tests["p_holm"].tolist() == pytest.approx([2 * tests["p"][0], 3 * smallest, 1.0])
    assert multipletests([0.01, 0.04, 0.03, 0.005], method="holm")[1].tolist() == pytest.approx(
        [0.03, 0.06, 0.06, 0.02]
    )


def test_pairs_share_samples_where_folds_are_missing(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    missing = [("pointnet", 0), *(("dgcnn", fold) for fold in (1, 2, 3, 4))]
    results = load_results(make_comparison(simulated, missing=missing))
    (test,) = pairwise_tests(results).to_dict("records")
    assert (test["samples"], test["only_first_correct"], test["p"]) == (0, 0, 1.0)
    assert correct_by_method(results)["dgcnn"].notna().sum() == 24


def test_one_method_has_no_pairs(simulated: PreparedDataset, make_comparison: MakeComparison) -> None:
    assert pairwise_tests(load_results(make_comparison(simulated, networks=("dgcnn",)))).empty
