# SPDX-License-Identifier: Apache-2.0
"""Runs of rules: predictions with reasons and angles, scores, detections where the rule was wrong."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from sklearn.metrics import f1_score

from doorstate._files import read_csv
from doorstate.clouds.preparation import CloudSpec
from doorstate.dataset.preparation import Preparation
from doorstate.dataset.prepare import prepare_dataset
from doorstate.dataset.roles import Role
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import ConfigError, DatasetError, RunError
from doorstate.rules import create_rule, list_rules
from doorstate.training.comparison import compare
from doorstate.training.experiment import Experiment
from doorstate.training.rule_run import RuleRunConfig, run_rule
from doorstate.types import ABSTAINED, STATES


@pytest.fixture(scope="module")
def doors(simulated_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> PreparedDataset:
    folder = tmp_path_factory.mktemp("doors") / "clouds"
    return prepare_dataset(
        Preparation(simulated_folder, CloudSpec(num_points=128)), folder, workers=1
    ).dataset


def config(rule: str) -> RuleRunConfig:
    return RuleRunConfig(rule=rule, parameters={}, dataset="d", protocol="paper", fold=0)


def test_predictions_are_those_of_the_rule_on_raw_frames(doors: PreparedDataset, tmp_path: Path) -> None:
    roles: dict[str, Role] = {row["sample_id"]: "test" for row in doors.rows[:9]}
    metrics = run_rule(config("plane_state"), doors, roles, tmp_path)
    rows = read_csv(tmp_path / "predictions.csv")
    assert [row["sample_id"] for row in rows] == list(roles)
    rule = create_rule("plane_state")
    for row in rows:
        expected = rule(doors.raw_cloud(doors.index_of(row["sample_id"])))
        assert row["predicted"] == (expected.state or ABSTAINED)
        assert row["reason"] == expected.reason
        assert (row["opening_angle_deg"] == "") == (expected.opening_angle_deg is None)
        assert row["open_or_not"] == {None: "", True: "open", False: "not_open"}[expected.open_or_not]
        assert {row[f"p_{state}"] for state in STATES} == {""}
    oracle = f1_score(
        [row["state"] for row in rows],
        [row["predicted"] for row in rows],
        labels=STATES,
        average="macro",
        zero_division=0,
    )
    assert metrics["test_macro_f1"] == pytest.approx(oracle)
    assert metrics["abstained"] == sum(row["predicted"] == ABSTAINED for row in rows)
    wrong = {row["sample_id"] for row in rows if row["predicted"] != row["state"]}
    records = [json.loads(line) for line in (tmp_path / "detections.jsonl").read_text().splitlines()]
    assert {record["sample_id"] for record in records} == wrong
    for record in records:
        for name, points in record["detections"]:
            assert name
            assert np.shape(points)[1:] == (3,)


def test_finished_run_is_returned_and_empty_run_refused(doors: PreparedDataset, tmp_path: Path) -> None:
    roles: dict[str, Role] = {doors.rows[0]["sample_id"]: "test"}
    first = run_rule(config("depth_region"), doors, roles, tmp_path / "a")
    assert run_rule(config("depth_region"), doors, roles, tmp_path / "a") == first
    with pytest.raises(RunError) as other:
        run_rule(config("depth_region"), doors, {}, tmp_path / "a")
    assert other.value.field == "splits"
    with pytest.raises(DatasetError, match="fold 0"):
        run_rule(config("depth_region"), doors, {}, tmp_path / "b")


def test_rules_are_not_applied_to_scenes_without_a_door(
    scene_dataset: PreparedDataset, tmp_path: Path
) -> None:
    roles: dict[str, Role] = {row["sample_id"]: "test" for row in scene_dataset.rows[-14:]}
    run_rule(config("depth_region"), scene_dataset, roles, tmp_path)
    assert {row["state"] for row in read_csv(tmp_path / "predictions.csv")} <= set(STATES)


def test_comparison_of_networks_and_rules(doors: PreparedDataset, tmp_path: Path) -> None:
    experiment = Experiment(
        name="both",
        dataset=str(doors.folder),
        networks=("pointnet",),
        rules=("angle_bins", "wall_leaf_angle"),
        folds=1,
        num_points=128,
        recipe_changes={"epochs": 1, "batch_size": 8, "precision": "fp32"},
    )
    metrics = compare(experiment, tmp_path / "c")
    assert [run_metrics["method"] for run_metrics in metrics] == ["pointnet", "angle_bins", "wall_leaf_angle"]
    with pytest.raises(ConfigError, match="angle"):
        experiment.model_copy(update={"rules": ("angle",)}).check()


def test_every_rule_has_a_source_and_parameters_with_defaults() -> None:
    for name in list_rules():
        rule = create_rule(name)
        assert (rule.name, bool(rule.source)) == (name, True)
        assert type(rule.parameters) is rule.defaults
