# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the tests of training."""

from __future__ import annotations

from pathlib import Path

import pytest

from doorstate.dataset.roles import Role
from doorstate.dataset.splits import draw_splits
from doorstate.dataset.store import PreparedDataset
from doorstate.training.run import train_run
from tests.training.runs import run_config


@pytest.fixture(scope="session")
def fold_roles(small_dataset: PreparedDataset) -> dict[str, Role]:
    """Roles of fold 0 of `small_dataset`."""
    return draw_splits(small_dataset.rows, "paper", 0)[0]


@pytest.fixture(scope="session")
def finished_run(
    small_dataset: PreparedDataset, fold_roles: dict[str, Role], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """Folder of a finished run."""
    folder = tmp_path_factory.mktemp("run") / "whole"
    train_run(run_config(), small_dataset, fold_roles, folder)
    return folder


@pytest.fixture(scope="session")
def scene_roles(scene_dataset: PreparedDataset) -> dict[str, Role]:
    """Return a fold with doors for validation, and with doors and scenes without one for testing."""
    without = {row["sample_id"] for row in scene_dataset.rows if row["state"] == "no_door"}
    for roles in draw_splits(scene_dataset.rows, "by-scene", 0):
        tested = {sample for sample, role in roles.items() if role == "test"}
        if (
            {s for s, role in roles.items() if role == "val"} - without
            and tested - without
            and tested & without
        ):
            return roles
    raise AssertionError("no such fold")
