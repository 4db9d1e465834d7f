# SPDX-License-Identifier: Apache-2.0
"""Description of the machine, and compilation with a fallback."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from torch._dynamo.exc import TorchDynamoException

from doorstate._environment import describe_environment
from doorstate.dataset.roles import Role
from doorstate.dataset.store import PreparedDataset
from doorstate.training.run import train_run
from tests.training.runs import RECIPE, run_config


def test_environment_is_json_with_versions_and_threads() -> None:
    environment = describe_environment()
    assert environment["torch"] == torch.__version__
    assert environment["threads"] == torch.get_num_threads()
    assert environment["processor"]
    assert json.loads(json.dumps(environment)) == environment


@pytest.mark.parametrize("works", [True, False])
def test_compilation_is_optional_and_falls_back(
    small_dataset: PreparedDataset,
    fold_roles: dict[str, Role],
    finished_run: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    works: bool,
) -> None:
    calls: list[int] = []

    def fake_compile(function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            calls.append(1)
            if not works:
                raise TorchDynamoException("no C++ compiler\nlong story")
            return function(*arguments, **options)

        return call

    monkeypatch.setattr(torch, "compile", fake_compile)
    recipe = RECIPE.model_copy(update={"compile": True})
    metrics = train_run(run_config(recipe=recipe), small_dataset, fold_roles, tmp_path / "compiled")
    expected = json.loads((finished_run / "metrics.json").read_text(encoding="utf-8"))
    assert metrics["test_macro_f1"] == expected["test_macro_f1"]
    assert (len(calls) > 1) == works
    warnings = [record.getMessage() for record in caplog.records if record.name.startswith("doorstate")]
    assert len(warnings) == (0 if works else 1)
    assert all("no C++ compiler" in warning for warning in warnings)
