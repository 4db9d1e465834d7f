# SPDX-License-Identifier: Apache-2.0
"""Undecidable frames by hand."""

from __future__ import annotations

import pytest

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.manifest import manifest_frame
from doorstate.evaluation.predictions import load_results
from doorstate.evaluation.stratum_tables import decidable_table, undecidable_table
from doorstate.evaluation.undecidable import (
    count_undecidable,
    decidable_accuracy,
    decidable_ceiling,
    records_twins,
)
from doorstate.types import STATES
from tests.evaluation.conftest import MakeComparison


def _row(pose: str, state: str, same: str = "") -> dict[str, str]:
    return {"sample_id": f"{pose}-{state}", "pose_id": pose, "state": state, "same_image_as": same}


@pytest.mark.parametrize(
    ("rows", "ceiling"),
    [
        ([_row("a", "closed"), _row("a", "semi_open"), _row("a", "open")], 1.0),
        ([_row("a", "closed"), _row("a", "semi_open", "open"), _row("a", "open", "semi_open")], 2 / 3),
        ([_row("a", s, " ".join(t for t in STATES if t != s)) for s in STATES], 1 / 3),
        ([_row("a", "open", "semi_open"), _row("b", "open", "semi_open")], 1.0),  # twins not in the sample
    ],
)
def test_ceiling_by_hand(rows: list[dict[str, str]], ceiling: float) -> None:
    assert decidable_ceiling(manifest_frame(rows)) == pytest.approx(ceiling)


def test_undecidable_frames_are_counted_apart(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    twin, decidable = simulated.rows[2]["sample_id"], simulated.rows[3]["sample_id"]
    wrong = {"dgcnn": {twin: "semi_open", decidable: "open"}}
    results = load_results(make_comparison(simulated, wrong))
    samples = 3 * 40
    assert count_undecidable(results.manifest)["undecidable"].tolist() == [0, 1, 1, 2]
    assert decidable_ceiling(results.manifest) == (samples - 1) / samples
    pointnet, dgcnn = decidable_accuracy(results).drop(columns="method").to_numpy().tolist()
    assert pointnet == [1, 1, 1, (samples - 1) / samples]
    assert dgcnn == pytest.approx(
        [(samples - 2) / samples, (samples - 3) / (samples - 2), 0.5, (samples - 1) / samples]
    )


def test_data_without_twins_have_empty_tables(
    imported: PreparedDataset, make_comparison: MakeComparison
) -> None:
    results = load_results(make_comparison(imported))
    assert not records_twins(results.manifest)
    assert undecidable_table(results.manifest).rows == decidable_table(results).rows == ()
