# SPDX-License-Identifier: Apache-2.0
"""Counts and scores by stratum against plain loops over the manifest."""

from __future__ import annotations

import math

import pytest

from doorstate.dataset.store import PreparedDataset
from doorstate.dataset.strata import BANDS, REGIONS
from doorstate.evaluation.manifest import manifest_frame
from doorstate.evaluation.predictions import load_results
from doorstate.evaluation.strata import ALL, count_samples, has_strata, score_strata
from doorstate.evaluation.stratum_tables import samples_table, state_table
from doorstate.types import STATES
from tests.evaluation.conftest import MakeComparison


def test_sample_counts_equal_a_plain_loop(simulated: PreparedDataset) -> None:
    counts = count_samples(manifest_frame(simulated.rows)).set_index(["state", "region"])
    assert len(counts) == 4 * 6
    for state in STATES:
        for region in REGIONS:
            expected = [
                sum(
                    (row["state"], row["region"], row["distance_band"]) == (state, region, band)
                    for row in simulated.rows
                )
                for band in BANDS
            ]
            assert counts.loc[(state, region)].tolist() == [*expected, sum(expected)]
    assert counts.loc[("open", ALL), ALL] == 40
    assert counts.loc[(ALL, ALL), ALL] == 3 * 40


def test_scores_equal_a_plain_loop(simulated: PreparedDataset, make_comparison: MakeComparison) -> None:
    wrong = {"pointnet": {row["sample_id"]: "open" for row in simulated.rows[::7]}}
    results = load_results(make_comparison(simulated, wrong))
    scores = score_strata(results, "open").set_index(["method", "region", "band"])
    assert len(scores) == 2 * 6 * 5
    for region in REGIONS:
        for band in BANDS:
            inside = [
                (row["state"], wrong["pointnet"].get(row["sample_id"], row["state"]))
                for row in simulated.rows
                if (row["region"], row["distance_band"]) == (region, band)
            ]
            cell = scores.loc[("pointnet", region, band)]
            hits = inside.count(("open", "open"))
            true, predicted = (
                sum(label == "open" for label in labels)
                for labels in ([s for s, _ in inside], [p for _, p in inside])
            )
            assert (cell["hits"], cell["state_samples"], cell["predicted_samples"]) == (hits, true, predicted)
            assert cell["recall"] == pytest.approx(hits / true if true else math.nan, nan_ok=True)
            assert cell["precision"] == pytest.approx(
                hits / predicted if predicted else math.nan, nan_ok=True
            )
    assert scores.loc[("dgcnn", ALL, ALL), "hits"] == scores.loc[("dgcnn", ALL, ALL), "state_samples"] == 40


def test_cells_of_the_state_table_are_share_and_counts(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    table = state_table(load_results(make_comparison(simulated)), "open", 6)
    assert len(table.rows) == 2 * 3 * 6
    cells = {row[:3]: row[3:] for row in table.rows}
    assert cells["dgcnn", "recall", "all"][-1] == "1.000 (40/40)"
    assert cells["dgcnn", "F1", "all"][-1] == "1.000"
    assert table.shades[0][-1] == 1.0


def test_an_empty_stratum_is_undefined(simulated: PreparedDataset, make_comparison: MakeComparison) -> None:
    unfinished = [("pointnet", fold) for fold in range(1, 5)]
    results = load_results(make_comparison(simulated, networks=["pointnet"], missing=unfinished))
    tested = results.tested[results.tested["state"] == "closed"]
    present = set(zip(tested["region"], tested["distance_band"], strict=True))
    scores = score_strata(results, "closed")
    inner = scores[(scores["region"] != ALL) & (scores["band"] != ALL)]
    assert 0 < len(present) < len(inner)
    for row in inner.to_dict("records"):
        assert math.isnan(row["f1"]) == ((row["region"], row["band"]) not in present)


def test_data_without_strata_have_empty_tables(
    imported: PreparedDataset, make_comparison: MakeComparison
) -> None:
    results = load_results(make_comparison(imported))
    assert not has_strata(results.manifest)
    for table in (samples_table(results.manifest), state_table(results, "closed", 4)):
        assert table.rows == ()
        assert table.note
