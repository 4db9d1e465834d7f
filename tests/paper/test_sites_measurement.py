# SPDX-License-Identifier: Apache-2.0
"""Measurement of adaptation on sites: results are kept, and the learning curve is their mean."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest
from paper.measurements.sites import learning_table, measure_site


def result(site: int, count: int, f1_after: float) -> dict[str, object]:
    return {
        "network": "pointnet2",
        "site": site,
        "count": count,
        "frames_before": 45,
        "f1_before": 0.5,
        "answered_before": 30,
        "wrong_before": 6,
        "frames_after": 45,
        "f1_after": f1_after,
        "answered_after": 40,
        "wrong_after": 2,
        "simulated_before": 0.9,
        "simulated_after": 0.895,
    }


def test_results_in_the_folder_are_not_measured_again(tmp_path: Path) -> None:
    path = tmp_path / "results" / "pointnet2-3-20-none.json"
    path.parent.mkdir()
    path.write_text(json.dumps(result(3, 20, 0.7)))
    rows = measure_site("pointnet2", Path("missing"), 3, [20], tmp_path, "none")
    assert rows == [result(3, 20, 0.7)]


def test_the_curve_has_means_and_intervals_over_sites() -> None:
    measured = [result(site, count, 0.6 + 0.02 * site) for site in range(6) for count in (5, 20)]
    table = learning_table(pd.DataFrame(measured)).frame
    assert table is not None
    assert table["count"].tolist() == [5, 20]
    assert table["gain"].tolist() == pytest.approx([0.15, 0.15])
    assert table["wrong_before"].tolist() == pytest.approx([0.2, 0.2])
    assert table["wrong_after"].tolist() == pytest.approx([0.05, 0.05])
    assert (table["gain_low"] < 0.15).all()
    assert (table["gain_high"] > 0.15).all()
    assert table["forgotten"].tolist() == pytest.approx([0.005, 0.005])
    assert learning_table(pd.DataFrame(measured[:4])).frame["gain_low"].isna().all()
