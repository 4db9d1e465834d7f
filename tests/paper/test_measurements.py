# SPDX-License-Identifier: Apache-2.0
"""Measurements on few clouds: types and relations of the results, one row per result in the tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from paper.measurements.dark_leaves import dark_table, measure_dark_leaves
from paper.measurements.export import ExportResult, export_table, measure_export
from paper.measurements.frames import varied_frames
from paper.measurements.gate import FAULTS, gate_table, measure_gate
from paper.measurements.ghost_results import append_results, method_table, read_results, size_table
from paper.measurements.ghosts import Ghosts, measure_ghosts
from paper.measurements.leveling import (
    Group,
    LevelingResult,
    draw_tilt,
    gazebo_clouds,
    leveling_table,
    measure_clouds,
    simulated_clouds,
)
from paper.measurements.outliers import measure_cost, measure_parts, parts_table
from paper.measurements.thinning import measure_thinning, thinning_table

from doorstate._jobs import no_progress
from doorstate.inference.reference_clouds import reference_clouds
from doorstate.networks.packaged import packaged_weights
from doorstate.types import STATES


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


def test_thinning_has_a_row_for_every_number_of_candidates() -> None:
    frames = varied_frames(2, no_progress)
    results = measure_thinning("pointnet2", ((row.state, frame.points) for row, frame in frames))
    assert len(results) == 2 * 9
    for result in results:
        assert result.probabilities.sum() == pytest.approx(1, abs=1e-5)
        assert 1024 <= result.candidates <= 640 * 480
    rows = thinning_table(results).rows
    assert [row[1] for row in rows] == ["all", *2 * ("2", "4", "8", "16")]
    assert rows[0][3] == "2 of 2"
    assert float(rows[0][6]) == 0


def test_varied_frames_have_many_sensors() -> None:
    rows = [row for row, _ in varied_frames(18, no_progress)]
    assert {row.sensor for row in rows} == {"none", "xtion", "d435", "deepdoors2", "kinect"}
    assert {row.state for row in rows} == set(STATES)


def test_gate_only_removes_states() -> None:
    results = measure_gate("ogurob-pointnet2", 2, no_progress)
    assert len(results) == 2 * len(FAULTS)
    assert all(result.gated in (None, result.ungated) for result in results)
    assert [row[0] for row in gate_table(results).rows] == list(FAULTS)


def test_dark_leaves_are_never_open() -> None:
    results = measure_dark_leaves("pointnet2", 5, no_progress)
    assert len(results) == 5 * 2 * 6
    assert "gate" in {result.answer for result in results}
    assert "open" not in {result.answer for result in results}
    rows = dark_table(results).rows
    assert len(rows) == 2 * 6
    assert {(row[2], row[6]) for row in rows} == {("4", "1")}


def test_ghosts_open_no_closed_door_once_they_are_removed(tmp_path: Path) -> None:
    conditions = [Ghosts(share=0, side_px=1), Ghosts(share=0.03, side_px=5, towards="front")]
    path = tmp_path / "ghosts.csv"
    assert read_results(path) == []
    for of_door in measure_ghosts("pointnet2", (0, 3), conditions):
        append_results(path, of_door)
    results = read_results(path)
    # Door 0 is closed: all methods, as an image and flat; door 3 gets the rules as well.
    assert {result.door for result in results} == {0, 3}
    network = [result for result in results if result.method == "pointnet2" and result.state == "closed"]
    assert {result.predicted for result in network if result.removed} <= {"closed", "abstained"}
    rows = method_table(results).rows
    assert {row[9] for row in rows if row[2] == "removed"} == {"0"}
    assert len(size_table(results, "pointnet2").rows) == 1


def test_clean_frames_keep_their_points() -> None:
    counts = measure_parts(1, no_progress)
    for sums in counts.values():
        assert sum(sums.removed.values()) < 0.01 * sum(sums.measured.values())
    assert len(parts_table(counts).rows) == 2 * len(counts)
    assert len(measure_cost(1).rows) == 3


def test_tilts_are_found_and_every_group_has_a_row() -> None:
    rendered, turned = (
        measure_clouds(simulated_clouds("varied", "d435", "tilted", 4, rendered=is_rendered))
        for is_rendered in (True, False)
    )
    for results in (rendered, turned, measure_clouds(gazebo_clouds("tilted", 4))):
        errors = [result.error_deg for result in results if result.error_deg is not None]
        assert len(errors) >= 2
        assert max(errors) < 1.5
    refused = [LevelingResult(None, None, None, "tilt_one_plane")]
    groups: list[Group] = [
        ("varied d435", "tilted", "rendered", rendered),
        ("varied d435", "tilted", "turned", turned),
        ("none", "level", "rendered", refused),
    ]
    table = leveling_table(groups)
    assert [row[0] for row in table.rows] == ["varied d435", "varied d435", "none", *["all"] * 4]
    assert table.rows[2][4:6] == ("0%", "–")


def test_drawn_tilts_are_within_their_limits() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        assert max(map(abs, draw_tilt("level", rng))) <= 1
        assert max(map(abs, draw_tilt("tilted", rng))) <= 30
        assert 60 <= abs(draw_tilt("on its side", rng)[0]) <= 120
