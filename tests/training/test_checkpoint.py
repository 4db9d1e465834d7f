# SPDX-License-Identifier: Apache-2.0
"""Damaged checkpoints."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import torch

from doorstate.dataset.roles import Role
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import RunError
from doorstate.training.run import train_run
from tests.training.runs import RECIPE, run_config


def test_damaged_checkpoint_is_refused_and_not_unpickled(
    small_dataset: PreparedDataset, fold_roles: dict[str, Role], tmp_path: Path
) -> None:
    run = tmp_path / "run"
    train_run(run_config(recipe=RECIPE.model_copy(update={"epochs": 1})), small_dataset, fold_roles, run)
    (run / "metrics.json").unlink()

    class Exploit:
        def __reduce__(self) -> tuple[Any, ...]:
            return (Path.touch, (tmp_path / "executed",))

    torch.save({"network": Exploit()}, run / "checkpoint.pt")
    with pytest.raises(RunError) as caught:
        train_run(run_config(recipe=RECIPE.model_copy(update={"epochs": 1})), small_dataset, fold_roles, run)
    assert caught.value.path == run / "checkpoint.pt"
    assert not (tmp_path / "executed").exists()
