# SPDX-License-Identifier: Apache-2.0
"""Measurements on few clouds: types and relations of the results, one row per result in the tables."""

from __future__ import annotations

import pytest
from paper.measurements.export import ExportResult, export_table, measure_export
from paper.measurements.gate import FAULTS, gate_table, measure_gate
from paper.measurements.thinning import measure_thinning, thinning_table

from doorstate._jobs import no_progress
from doorstate.inference.reference_clouds import reference_clouds
from doorstate.networks.packaged import packaged_weights


def test_exported_networks_agree_with_torch() -> None:
    clouds = reference_clouds(3, 128)
    exact, rounded = measure_export(packaged_weights("pointnet2"), clouds, no_progress)
    assert exact.parity is not None
    assert rounded.parity is not None
    assert exact.parity.max_difference <= 1e-4 < rounded.parity.max_difference
    assert exact.parity.num_correct == exact.parity.num_correct_torch == rounded.parity.num_correct_torch
    assert rounded.megabytes < exact.megabytes / 2
    assert len(export_table([exact, rounded]).rows) == 2


def test_network_that_is_not_written_has_a_row() -> None:
    table = export_table([ExportResult("dgcnn", "onnxruntime", 3)])
    assert table.rows == (("dgcnn", "onnxruntime", "not written", *["–"] * 4),)


def test_thinning_gives_probabilities_of_both_samplings() -> None:
    results = measure_thinning("ogurob-pointnet2", 3, no_progress)
    assert len(results) == 3
    for result in results:
        assert sum(result.thinned.raw_probabilities.values()) == pytest.approx(1)
        assert sum(result.full.raw_probabilities.values()) == pytest.approx(1)
    assert thinning_table(results).rows[0][0] == "3"


def test_gate_only_removes_states() -> None:
    results = measure_gate("ogurob-pointnet2", 2, no_progress)
    assert len(results) == 2 * len(FAULTS)
    assert all(result.gated in (None, result.ungated) for result in results)
    assert [row[0] for row in gate_table(results).rows] == list(FAULTS)
