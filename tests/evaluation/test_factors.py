# SPDX-License-Identifier: Apache-2.0
"""Accuracy by bin against counting by hand."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from pathlib import Path

import pytest

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.factors import FACTORS, factor_bins, factors_figure, factors_table
from doorstate.evaluation.results import load_results

OF_THIS_PRESET = FACTORS[:4]  # one camera, level, and nothing in its way


def test_bins_hold_what_counting_finds(
    simulated: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    wrong = {
        row["sample_id"]: "closed" for row in simulated.rows if 35 <= float(row["opening_angle_deg"]) < 55
    }
    results = load_results(make_comparison(simulated, {"dgcnn": wrong}))
    tested = results.pooled("dgcnn").sample_ids
    angles = [float(simulated.rows[simulated.index_of(name)]["opening_angle_deg"]) for name in tested]
    bins = [
        b for b in factor_bins(results, simulated) if b.method == "dgcnn" and b.factor == FACTORS[0].title
    ]
    for each in bins:
        assert each.samples == sum(each.low <= angle < each.high for angle in angles)
        assert each.right == (0 if 35 <= each.low < 55 else each.samples)
    assert sum(each.samples for each in bins) == len(tested) > 0
    assert not any(each.low == 3 for each in bins)  # no door of this data set is ajar by 3 to 15 degrees


def test_every_sample_has_a_place_by_every_factor(
    simulated: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    results = load_results(make_comparison(simulated))
    bins = list(factor_bins(results, simulated))
    for method in results.networks:
        for factor in OF_THIS_PRESET:
            counts = [each.samples for each in bins if each.method == method and each.factor == factor.title]
            assert sum(counts) == len(results.pooled(method))
    rows = list(csv.DictReader(factors_table(results, simulated).to_csv().splitlines()))
    assert len(rows) == len(bins)
    assert {row["accuracy"] for row in rows} == {"1.0000"}


def test_heading_is_seen_from_the_bearing_to_the_door() -> None:
    heading = FACTORS[3].value
    assert heading({"x_m": "0", "y_m": "2", "heading_deg": "-90"}) == pytest.approx(0)
    assert heading({"x_m": "-2", "y_m": "2", "heading_deg": "-35"}) == pytest.approx(
        10
    )  # past it, to its left
    assert heading({"x_m": "0", "y_m": "2", "heading_deg": "260"}) == pytest.approx(-10)
    assert math.isnan(heading({"x_m": "0", "y_m": "2"}))


def test_the_figure_has_a_line_for_each_method(
    simulated: PreparedDataset, imported: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    results = load_results(make_comparison(simulated))
    figure = factors_figure(results, simulated)
    assert figure is not None
    assert [axis.get_xlabel() for axis in figure.axes] == [factor.title for factor in OF_THIS_PRESET]
    assert {line.get_label() for line in figure.axes[0].lines} == set(results.networks)


def test_data_that_know_nothing_of_their_poses_have_no_figure(
    imported: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    results = load_results(make_comparison(imported))
    assert factors_figure(results, imported) is None
    assert factors_table(results, imported).rows == ()
