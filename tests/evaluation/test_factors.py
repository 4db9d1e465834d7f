# SPDX-License-Identifier: Apache-2.0
"""Accuracy by bin against counting by hand."""

from __future__ import annotations

import pandas as pd
import pytest

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.factors import FACTORS, score_factors
from doorstate.evaluation.figures.factors import factors_figure
from doorstate.evaluation.predictions import load_results
from tests.evaluation.conftest import MakeComparison

OF_THIS_PRESET = FACTORS[:4]  # one camera, level, and nothing in its way


def test_bins_equal_counting(simulated: PreparedDataset, make_comparison: MakeComparison) -> None:
    angles = {row["sample_id"]: float(row["opening_angle_deg"]) for row in simulated.rows}
    wrong = {name: "closed" for name, angle in angles.items() if 35 <= angle < 55}
    bins = score_factors(load_results(make_comparison(simulated, {"dgcnn": wrong})))
    bins = bins[(bins["method"] == "dgcnn") & (bins["factor"] == FACTORS[0].title)]
    for row in bins.to_dict("records"):
        assert row["samples"] == sum(row["low"] <= angle < row["high"] for angle in angles.values())
        assert row["correct"] == (0 if 35 <= row["low"] < 55 else row["samples"])
    assert bins["samples"].sum() == len(angles)
    assert not (bins["low"] == 3).any()  # no door of this data set is open by 3 to 15 degrees


def test_each_sample_is_in_one_bin_of_each_factor(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    results = load_results(make_comparison(simulated))
    bins = score_factors(results)
    samples = bins.groupby(["method", "factor"])["samples"].sum()
    assert len(samples) == len(results.methods) * len(OF_THIS_PRESET)
    assert (samples == len(simulated.rows)).all()
    assert (bins["accuracy"] == 1).all()


@pytest.mark.parametrize(
    ("x_m", "y_m", "heading_deg", "offset_deg"),
    [(0, 2, -90, 0), (-2, 2, -35, 10), (0, 2, 260, -10)],
)
def test_heading_is_relative_to_the_bearing_of_the_door(
    x_m: float, y_m: float, heading_deg: float, offset_deg: float
) -> None:
    rows = pd.DataFrame({"x_m": [x_m], "y_m": [y_m], "heading_deg": [heading_deg]}, dtype="float64")
    assert FACTORS[3].value(rows).tolist() == pytest.approx([offset_deg])
    assert FACTORS[3].value(rows.drop(columns="heading_deg")).isna().all()


def test_figure_has_a_line_for_each_method(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    results = load_results(make_comparison(simulated))
    figure = factors_figure(results)
    assert figure is not None
    assert [axis.get_xlabel() for axis in figure.axes] == [factor.title for factor in OF_THIS_PRESET]
    assert {line.get_label() for line in figure.axes[0].lines} == set(results.methods)


def test_data_without_poses_have_no_factors(
    imported: PreparedDataset, make_comparison: MakeComparison
) -> None:
    results = load_results(make_comparison(imported))
    assert factors_figure(results) is None
    assert score_factors(results).empty
