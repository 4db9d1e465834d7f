# SPDX-License-Identifier: Apache-2.0
"""Errors of further heads against errors that the test puts in."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from doorstate._files import write_csv
from doorstate.dataset.splits import draw_splits, write_splits
from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.factors import kinds_table
from doorstate.evaluation.head_tables import (
    answer_errors,
    answers_table,
    four_answers_table,
    parts_table,
    presence_table,
)
from doorstate.evaluation.report import write_report
from doorstate.evaluation.results import Answers, ComparisonResults, load_results
from doorstate.evaluation.rule_tables import angle_table
from doorstate.evaluation.table import UNDEFINED, Table
from doorstate.types import NO_DOOR, STATES

OFF = {
    "door_x_m": 0.03,
    "door_y_m": -0.04,
    "door_yaw_deg": 359.0,
    "opening_width_m": 0.02,
    "passable_width_m": 0.05,
}


def comparison(dataset: PreparedDataset, folder: Path, wrong_hinges: int = 0) -> Path:
    """Five folds of a network that is off by what the test says, and sees a door in every second empty scene."""
    splits = draw_splits(dataset.rows, "by-scene", 0)
    write_splits(folder / "splits.csv", splits)
    document = {
        "name": "heads",
        "dataset": str(dataset.folder),
        "protocol": "by-scene",
        "networks": ["pointnet2"],
    }
    document |= {"folds": 5, "num_points": 160, "seed": 0}  # type: ignore[dict-item]
    (folder / "comparison.json").write_text(json.dumps(document))
    empty = hinged = 0
    for fold, roles in enumerate(splits):
        rows = [row for row in dataset.rows if roles[row["sample_id"]] == "test"]
        run = folder / "runs" / "pointnet2" / f"fold{fold}"
        said = []
        for row in rows:
            answer = {name: str(float(row[name] or 0) + off) for name, off in OFF.items()}
            answer["opening_angle_deg"] = str(float(row["opening_angle_deg"] or 0) + 4)
            p_door = 0.9
            if row["state"] == NO_DOOR:
                empty += 1
                p_door = 0.8 if empty % 2 else 0.1
            left = row["hinge"] == "left"
            if row["hinge"]:
                hinged += 1
                left ^= hinged <= wrong_hinges
            answer |= {"p_door": str(p_door), "p_hinge_left": str(float(left))}
            said.append({"sample_id": row["sample_id"]} | answer)
        write_csv(run / "head_outputs.csv", said)
        write_csv(
            run / "predictions.csv",
            [
                {"sample_id": row["sample_id"], "state": row["state"], "predicted": row["state"]}
                | {f"p_{state}": str(float(state == row["state"])) for state in STATES}
                for row in rows
                if row["state"] != NO_DOOR
            ],
        )
        counts = [[8, 2], [0, 10]]
        whole = np.zeros((6, 6), dtype=int)
        whole[:2, :2] = counts
        (run / "metrics.json").write_text(json.dumps({"best_epoch": 0, "test_part_counts": whole.tolist()}))
    return folder


@pytest.fixture
def results(scene_dataset: PreparedDataset, tmp_path: Path) -> ComparisonResults:
    return load_results(comparison(scene_dataset, tmp_path / "c", wrong_hinges=6))


def only_row(table: Table) -> dict[str, str]:
    (row,) = csv.DictReader(table.to_csv().splitlines())
    return row


def test_errors_are_those_that_were_put_in(
    results: ComparisonResults, scene_dataset: PreparedDataset
) -> None:
    row = only_row(answers_table(results, scene_dataset))
    assert row["samples"] == "36"
    assert row["opening angle, semi-open: mean error, °"] == "4.0"
    assert row["open"] == "4.0"
    assert row["frame position: median error, m"] == row["90th percentile"] == "0.050"
    assert row["yaw: median error, °"] == "1.0"
    assert row["opening width: mean error, m"] == "0.020"
    assert row["passable width: mean error, m"] == "0.050"
    assert row["hinge side"] == f"{18 / 24:.4f}"
    given = results.answers("pointnet2")
    assert given is not None
    rows = [scene_dataset.rows[scene_dataset.index_of(name)] for name in given.sample_ids]
    ajar = [
        (row["hinge"] == "left") == (p > 0.5)
        for row, p in zip(rows, given.columns["p_hinge_left"], strict=True)
        if row["state"] in ("semi_open", "open")
    ]
    assert len(ajar) == 16
    assert row["of doors not closed"] == f"{sum(ajar) / 16:.4f}"
    assert 0 < sum(ajar) < 16
    assert float(row["door, AUROC"]) == 1  # 0.9 beats 0.8: a threshold between them tells all apart


def test_presence_is_counted_by_what_is_there(
    results: ComparisonResults, scene_dataset: PreparedDataset
) -> None:
    rows = list(csv.DictReader(presence_table(results, scene_dataset).to_csv().splitlines()))
    doors = [row for row in rows if row["a door"] == "yes"]
    empty = [row for row in rows if row["a door"] == "no"]
    assert sum(int(row["samples"]) for row in doors) == sum(int(row["said yes"]) for row in doors) == 24
    assert sum(int(row["samples"]) for row in empty) == 12
    assert sum(int(row["said yes"]) for row in empty) == 6
    assert {row["kind"] for row in empty} == {
        r["scene_kind"] for r in scene_dataset.rows if r["state"] == NO_DOOR
    }


def test_no_door_is_an_answer_beside_the_states(
    results: ComparisonResults, scene_dataset: PreparedDataset
) -> None:
    row = only_row(four_answers_table(results, scene_dataset))
    assert row["samples"] == "36"
    assert {row[f"right of {state}"] for state in STATES} == {"1.0000"}
    assert row["right of no_door"] == "0.5000"  # of 12
    assert row["mean"] == f"{(3 + 0.5) / 4:.4f}"
    assert row["of all"] == f"{(24 + 6) / 36:.4f}"


def test_an_angle_is_off_by_no_more_than_half_a_turn(scene_dataset: PreparedDataset) -> None:
    row = next(row for row in scene_dataset.rows if row["state"] == "open" and row["opening_angle_deg"])
    true = float(row["opening_angle_deg"])
    for said, off in ((true + 10, 10), (true - 10, 10), (true + 350, 10), (true - 190, 170)):
        given = Answers((row["sample_id"],), {"opening_angle_deg": np.array([said])})
        assert answer_errors(given, scene_dataset)["open"] == pytest.approx(off)


def test_parts_by_hand(results: ComparisonResults) -> None:
    row = only_row(parts_table(results))
    assert row["wall"] == "0.800"
    assert row["frame"] == f"{10 / 12:.3f}"
    assert row["leaf"] in ("", UNDEFINED)
    assert row["mean"] == f"{(0.8 + 10 / 12) / 2:.3f}"


def test_angles_and_kinds_of_networks_are_in_the_other_tables(
    results: ComparisonResults, scene_dataset: PreparedDataset
) -> None:
    rows = list(csv.DictReader(angle_table(results, scene_dataset).to_csv().splitlines()))
    assert {row["mean"] for row in rows} == {"4.0"}
    kinds = list(csv.DictReader(kinds_table(results, scene_dataset).to_csv().splitlines()))
    by_door = [row for row in kinds if row["kind"] == "door_kind"]
    assert sum(int(row["samples"]) for row in by_door) == 24
    assert {row["accuracy"] for row in by_door} == {"1.0000"}


def test_the_report_shows_them(scene_dataset: PreparedDataset, tmp_path: Path) -> None:
    page = write_report([comparison(scene_dataset, tmp_path / "c")], tmp_path / "report")
    text = page.read_text(encoding="utf-8")
    for title in (
        "Answers of further heads",
        "Is there a door?",
        "intersection over union",
        "by kind of sample",
    ):
        assert title in text
