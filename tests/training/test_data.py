# SPDX-License-Identifier: Apache-2.0
"""Splits that cannot be trained on."""

from __future__ import annotations

from pathlib import Path

import pytest

from doorstate.dataset.roles import Role
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import ConfigError, DatasetError
from doorstate.training.data import RunData
from doorstate.training.run import train_run
from tests.training.runs import run_config


def test_split_without_validation_samples_is_refused(small_dataset: PreparedDataset, tmp_path: Path) -> None:
    names = [row["sample_id"] for row in small_dataset.rows]
    unvalidated: dict[str, Role] = dict.fromkeys(names[:-5], "train") | dict.fromkeys(names[-5:], "test")  # type: ignore[assignment]
    with pytest.raises(DatasetError, match="0 samples for val"):
        train_run(run_config(), small_dataset, unvalidated, tmp_path / "run")


def test_validation_samples_without_a_door_are_refused(
    scene_dataset: PreparedDataset, scene_roles: dict[str, Role], tmp_path: Path
) -> None:
    doorless = {
        s: "unused" if r == "val" and not s.endswith("no_door") else r for s, r in scene_roles.items()
    }
    doorless |= {row["sample_id"]: "val" for row in scene_dataset.rows[-2:]}
    with pytest.raises(DatasetError, match="door for val"):
        train_run(run_config(heads=("door",)), scene_dataset, doorless, tmp_path)  # type: ignore[arg-type]


def test_scenes_without_a_door_need_the_door_head(
    scene_dataset: PreparedDataset, scene_roles: dict[str, Role], tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match="door"):
        train_run(run_config(heads=("angle",)), scene_dataset, scene_roles, tmp_path)


def test_a_share_of_the_scenes_trains_and_all_others_are_tested_as_before(
    scene_dataset: PreparedDataset, more_dataset: PreparedDataset, scene_roles: dict[str, Role]
) -> None:
    whole = RunData(scene_dataset, scene_roles, ("door",), [more_dataset])
    part = RunData(scene_dataset, scene_roles, ("door",), [more_dataset], train_share=0.5)
    assert 0 < part.num_extra < whole.num_extra == len(more_dataset)
    assert 0 < len(part.samples["train"]) < len(whole.samples["train"])
    assert set(part.samples["train"]) < set(whole.samples["train"])
    assert part.num_train == len(part.samples["train"]) + part.num_extra
    assert (part.samples["val"], part.samples["test"]) == (whole.samples["val"], whole.samples["test"])
    loader = part.epoch_loaders(128, lambda points: (), False).train
    assert loader.sample_ids == part.samples["train"] + part.extra[0][1]


def test_a_run_with_all_scenes_is_stored_as_before() -> None:
    config = run_config()
    assert "train_share" not in config.model_dump()
    assert config.model_copy(update={"train_share": 0.25}).model_dump(mode="json")["train_share"] == 0.25
