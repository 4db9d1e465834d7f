# SPDX-License-Identifier: Apache-2.0
"""Errors of further heads against errors that the test puts in."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from doorstate._files import write_csv
from doorstate.dataset.splits import draw_splits, write_splits
from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.factors import score_kinds
from doorstate.evaluation.gallery import build_gallery
from doorstate.evaluation.head_tables import head_tables
from doorstate.evaluation.heads import (
    head_errors,
    head_rows,
    score_four_labels,
    score_heads,
    score_parts,
    score_presence,
    standard_errors,
)
from doorstate.evaluation.predictions import load_results
from doorstate.evaluation.report import render_report
from doorstate.evaluation.report_parts import ReportParts
from doorstate.evaluation.results import Results
from doorstate.evaluation.rule_outputs import score_angles
from doorstate.evaluation.tables import build_tables
from doorstate.types import NO_DOOR, STATES
from tests.evaluation.conftest import MakeComparison

OFFSETS = {
    "door_x_m": 0.03,
    "door_y_m": -0.04,
    "door_yaw_deg": 359.0,
    "opening_width_m": 0.02,
    "passable_width_m": 0.05,
}


def write_comparison(dataset: PreparedDataset, folder: Path, wrong_hinges: int) -> Path:
    """Write five folds of a network with `OFFSETS` as errors that predicts a door in every second empty scene."""
    splits = draw_splits(dataset.rows, "by-scene", 0)
    write_splits(folder / "splits.csv", splits)
    document = {"name": "heads", "dataset": str(dataset.folder), "protocol": "by-scene"}
    document |= {"networks": ["pointnet2"], "folds": 5, "num_points": 160, "seed": 0}  # type: ignore[dict-item]
    (folder / "comparison.json").write_text(json.dumps(document))
    empty = hinged = 0
    for fold, roles in enumerate(splits):
        rows = [row for row in dataset.rows if roles[row["sample_id"]] == "test"]
        run = folder / "runs" / "pointnet2" / f"fold{fold}"
        outputs = []
        for row in rows:
            output = _moved(row)
            p_door = 0.9
            if row["state"] == NO_DOOR:
                empty += 1
                p_door = 0.8 if empty % 2 else 0.1
            left = row["hinge"] == "left"
            if row["hinge"]:
                hinged += 1
                left ^= hinged <= wrong_hinges
            output |= {"p_door": str(p_door), "p_hinge_left": str(float(left))}
            outputs.append({"sample_id": row["sample_id"]} | output)
        write_csv(run / "head_outputs.csv", outputs)
        write_csv(run / "predictions.csv", _right_states(rows))
        validated = [row for row in dataset.rows if roles[row["sample_id"]] == "val"]
        write_csv(run / "validation.csv", _right_states(validated))
        write_csv(
            run / "validation_heads.csv", [{"sample_id": row["sample_id"]} | _moved(row) for row in validated]
        )
        counts = np.zeros((6, 6), dtype=int)
        counts[:2, :2] = [[8, 2], [0, 10]]
        (run / "metrics.json").write_text(json.dumps({"test_part_counts": counts.tolist()}))
    return folder


def _moved(row: Mapping[str, str]) -> dict[str, str]:
    """Return the true values of a row with `OFFSETS`, and 4 degrees too wide."""
    offsets = OFFSETS | {"opening_angle_deg": 4}
    return {name: str(float(row[name] or 0) + offset) for name, offset in offsets.items()}


def _right_states(rows: Sequence[Mapping[str, str]]) -> list[dict[str, str]]:
    return [
        {"sample_id": row["sample_id"], "state": row["state"], "predicted": row["state"]}
        | {f"p_{state}": str(float(state == row["state"])) for state in STATES}
        for row in rows
        if row["state"] != NO_DOOR
    ]


@pytest.fixture
def results(scene_dataset: PreparedDataset, tmp_path: Path) -> Results:
    return load_results(write_comparison(scene_dataset, tmp_path / "c", wrong_hinges=6))


def test_errors_are_those_that_were_put_in(results: Results) -> None:
    (row,) = score_heads(results).to_dict("records")
    assert row["samples"] == 36
    assert row["angle_error_semi_open_deg"] == pytest.approx(4)
    assert row["angle_error_open_deg"] == pytest.approx(4)
    assert row["frame_position_error_median_m"] == pytest.approx(0.05)
    assert row["frame_position_error_p90_m"] == pytest.approx(0.05)
    assert row["frame_yaw_error_median_deg"] == pytest.approx(1)
    assert row["opening_width_error_m"] == pytest.approx(0.02)
    assert row["passable_width_error_m"] == pytest.approx(0.05)
    assert row["hinge_accuracy"] == 18 / 24
    assert row["door_auroc"] == 1  # 0.9 beats 0.8: a threshold between them tells all apart
    outputs = head_rows(results, "pointnet2")
    assert outputs is not None
    not_closed = outputs[outputs["state"].isin(["semi_open", "open"])]
    correct = (not_closed["hinge"] == "left") == (not_closed["p_hinge_left"] > 0.5)
    assert len(correct) == 16
    assert row["hinge_accuracy_not_closed"] == correct.mean()
    assert 0 < correct.mean() < 1


def test_standard_errors_are_those_of_validation_doors(results: Results) -> None:
    errors = standard_errors(results, "pointnet2")
    assert errors is not None
    assert (errors.along_m, errors.across_m) == pytest.approx((0.03, 0.04))
    assert (errors.yaw_deg, errors.width_m) == pytest.approx((1, 0.02))
    assert errors.angle_deg == pytest.approx({"closed": 4, "semi_open": 4, "open": 4})


def test_presence_is_counted_by_kind(results: Results, scene_dataset: PreparedDataset) -> None:
    presence = score_presence(results)
    doors, empty = presence[presence["door"]], presence[~presence["door"]]
    assert doors["samples"].sum() == doors["predicted_door"].sum() == 24
    assert (empty["samples"].sum(), empty["predicted_door"].sum()) == (12, 6)
    assert set(empty["kind"]) == {row["scene_kind"] for row in scene_dataset.rows if row["state"] == NO_DOOR}


def test_no_door_is_a_fourth_label(results: Results) -> None:
    (row,) = score_four_labels(results).to_dict("records")
    assert [row[state] for state in STATES] == [1, 1, 1]
    assert row[NO_DOOR] == 0.5  # of 12
    assert row["mean"] == (3 + 0.5) / 4
    assert row["accuracy"] == (24 + 6) / 36


@pytest.mark.parametrize(("offset", "error"), [(10, 10), (-10, 10), (350, 10), (-190, 170)])
def test_an_angle_error_is_at_most_half_a_turn(results: Results, offset: float, error: float) -> None:
    rows = head_rows(results, "pointnet2")
    assert rows is not None
    changed = rows.assign(opening_angle_deg_predicted=rows["opening_angle_deg"] + offset)
    assert head_errors(changed)["angle_error_open_deg"] == pytest.approx(error)


def test_part_scores_by_hand(results: Results) -> None:
    (row,) = score_parts(results).to_dict("records")
    assert row["wall"] == 0.8
    assert row["frame"] == pytest.approx(10 / 12)
    assert np.isnan(row["leaf"])
    assert row["mean"] == pytest.approx((0.8 + 10 / 12) / 2)


def test_angles_and_kinds_of_networks_are_scored(results: Results) -> None:
    np.testing.assert_allclose(score_angles(results)["mean_deg"], 4)
    kinds = score_kinds(results)
    by_door = kinds[kinds["kind"] == "door_kind"]
    assert by_door["samples"].sum() == by_door["correct"].sum() == 24


def test_report_shows_the_tables_of_heads(results: Results, scene_dataset: PreparedDataset) -> None:
    parts = ReportParts(build_tables(results), {}, build_gallery(results, scene_dataset))
    page = render_report(results, scene_dataset, parts)
    for name in ("head_errors", "four_labels", "presence", "parts", "kinds"):
        assert f'<figure class="table" id="{name}">' in page, name


def test_networks_without_heads_have_no_rows(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    results = load_results(make_comparison(simulated))
    assert head_rows(results, "pointnet") is None
    assert all(not table.rows for table in head_tables(results).values())
