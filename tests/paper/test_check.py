# SPDX-License-Identifier: Apache-2.0
"""Published numbers follow from the committed predictions, and the headline numbers stay what they were."""

from __future__ import annotations

from dataclasses import replace

import pytest
from paper.check import check, wrong_metrics
from paper.published import comparison, side_by_side

from doorstate.evaluation.method_scores import summarize_methods

# Macro F1 and errors of version 0.1.
HEADLINES = {
    "paper": {
        "pointnet": (0.9914, 35),
        "pointnet2": (0.9973, 11),
        "dgcnn": (0.9906, 38),
        "pointcnn": (0.9924, 31),
        "point2sequence": (0.9924, 31),
    },
    "by-pose": {
        "pointnet": (0.8482, 611),
        "pointnet2": (0.9346, 263),
        "dgcnn": (0.8640, 550),
        "pointcnn": (0.8763, 493),
        "point2sequence": (0.9205, 318),
    },
    "by-pose-mirrored": {"pointnet2": (0.9691, 125)},
    "related": {
        "mvcnn": (0.9894, 43),
        "open_door": (0.2539, 3222),
        "plane_state": (0.9673, 222),
        "wall_leaf_angle": (0.9919, 51),
        "angle_bins": (0.9177, 437),
        "depth_region": (0.3080, 2533),
    },
    "mixture-wide": {
        "pointnet2": (0.9003, 226),
        "dgcnn": (0.7635, 532),
        "pointcnn": (0.6327, 808),
        "pointnet": (0.7110, 652),
        "point2sequence": (0.6594, 778),
        "wall_leaf_angle": (0.6269, 932),
    },
}


@pytest.mark.parametrize("name", HEADLINES)
def test_headline_scores(name: str) -> None:
    summary = summarize_methods(comparison(name))
    scores = {
        method: (round(f1, 4), errors)
        for method, f1, errors in zip(summary["method"], summary["f1"], summary["errors"], strict=True)
    }
    assert scores == HEADLINES[name]


def test_rules_are_shown_beside_the_networks_of_the_paper() -> None:
    assert side_by_side("related").methods == (*HEADLINES["paper"], *HEADLINES["related"])


@pytest.mark.slow
def test_everything_published_follows_from_the_committed_predictions() -> None:
    assert check() == []


def test_a_recorded_score_that_differs_from_its_predictions_is_reported() -> None:
    results = comparison("by-pose-mirrored")
    first = results.runs[0]
    changed = replace(first, metrics={**first.metrics, "test_macro_f1": first.metric("test_macro_f1") + 1e-3})
    assert list(wrong_metrics(results)) == []
    (problem,) = wrong_metrics(replace(results, runs=(changed, *results.runs[1:])))
    assert "pointnet2, fold 0: test_macro_f1" in problem
