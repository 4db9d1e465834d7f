# SPDX-License-Identifier: Apache-2.0
"""One command makes the default weights."""

from __future__ import annotations

from pathlib import Path

import pytest
from paper.pages import render
from paper.train_default import app
from typer.testing import CliRunner

from paper import datasets, paths, publish, run, weights


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Steps that are taken, none of which does anything."""
    taken: list[str] = []
    monkeypatch.setattr(run, "run", lambda name, options="": taken.append(f"run {name} {options}"))
    monkeypatch.setattr(publish, "publish", lambda name: taken.append(f"publish {name}"))

    def package(name: str) -> list[Path]:
        taken.append(f"weights {name}")
        return []

    monkeypatch.setattr(weights, "package_weights", package)
    monkeypatch.setattr(render, "write_pages", list)
    return taken


def test_weights_are_packaged_after_the_run_is_published(steps: list[str]) -> None:
    assert CliRunner().invoke(app, []).exit_code == 0
    assert steps == ["run default --device auto", "publish default", "weights default"]


def test_device_and_epochs_reach_the_run(steps: list[str]) -> None:
    assert CliRunner().invoke(app, ["--device", "cuda", "--epochs", "7"]).exit_code == 0
    assert steps[0] == "run default --device cuda --epochs 7"


def test_data_of_the_default_weights_share_no_seed_with_another_data_set() -> None:
    seeds = [
        command.split("--seed ")[1].split()[0]
        for command in datasets.SIMULATED.values()
        if "--seed" in command
    ]
    own = [
        command.split("--seed ")[1].split()[0]
        for name, command in datasets.SIMULATED.items()
        if name.startswith(("default-", "more-default-"))
    ]
    assert all(seeds.count(seed) == 1 for seed in own)
    assert (paths.EXPERIMENTS / "default.toml").is_file()
