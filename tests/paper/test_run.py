# SPDX-License-Identifier: Apache-2.0
"""Experiments run in order, on data sets that the command line can make."""

from __future__ import annotations

import json
import tomllib
from contextlib import nullcontext
from itertools import pairwise
from pathlib import Path

import pytest
from paper.publish import publish

from doorstate.dataset.store import PreparedDataset
from doorstate.simulation.settings import settings_for
from doorstate.training.comparison import compare
from doorstate.training.experiment import load_experiment
from doorstate.training.run_folder import RunFolder
from paper import commands, datasets, paths, published, run

DEFINITIONS = sorted(paths.EXPERIMENTS.glob("*.toml"))


@pytest.fixture
def called(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Commands that an experiment would run; a data set is `make NAME`."""
    lines: list[str] = []
    monkeypatch.setattr(run, "run_doorstate", lambda arguments, prepared=None: lines.append(arguments))
    monkeypatch.setattr(
        run, "dataset_commands", lambda folder: [datasets.Command(f"make {folder.name}", folder)]
    )
    return lines


@pytest.mark.parametrize("path", DEFINITIONS, ids=lambda path: path.stem)
def test_an_experiment_runs_after_its_data_and_the_experiments_it_starts_from(
    path: Path, called: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(paths, "RUNS", tmp_path)
    run.run(path.stem)
    made = {line.removeprefix("make ") for line in called if line.startswith("make ")}
    content = tomllib.loads(path.read_text())
    needed = [
        *(content.get("tested", {}).values() or [content["dataset"]]),
        *content.get("extra_train_datasets", []),
    ]
    assert {Path(folder).name for folder in needed} <= made
    (own,) = (number for number, line in enumerate(called) if f"/{path.name}" in line)
    for start in content.get("trained", {}).values() or filter(None, [content.get("start_from")]):
        name = f"compare paper/experiments/{Path(start).name}.toml"
        (number,) = (number for number, line in enumerate(called) if name in line)
        assert number < own


def test_a_finished_experiment_is_not_run_again_for_those_that_start_from_it(
    called: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(paths, "RUNS", tmp_path)
    folder = tmp_path / "mixture-longer"
    folder.mkdir()
    content = {"name": folder.name, "dataset": "data", "networks": ["pointnet2"], "rules": [], "folds": 1}
    (folder / "comparison.json").write_text(json.dumps(content))
    for is_finished in (False, True):
        if is_finished:
            RunFolder(folder / "runs" / "pointnet2" / "fold0").finish({})
        called.clear()
        run.run("mixture-wide")
        assert any("mixture-longer.toml" in line for line in called) is not is_finished
        assert any("mixture-wide.toml" in line for line in called)


@pytest.mark.parametrize(
    ("exit_code", "is_made", "goes_on"),
    [(0, True, True), (1, True, True), (1, False, False), (2, True, False)],
)
def test_an_incomplete_data_set_is_used_and_a_failure_ends_the_program(
    exit_code: int, is_made: bool, goes_on: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    program = tmp_path / "doorstate"
    program.write_text(f"#!/bin/sh\nexit {exit_code}\n")
    program.chmod(0o755)
    if is_made:
        (tmp_path / "dataset.json").touch()
    monkeypatch.setattr(commands.sys, "executable", str(tmp_path / "python"))
    with nullcontext() if goes_on else pytest.raises(SystemExit) as raised:
        commands.run_doorstate("simulate", tmp_path)
    if raised is not None:
        assert raised.value.code == exit_code


def test_data_sets_are_made_with_presets_and_sensors_that_exist(tmp_path: Path) -> None:
    seeds: dict[str, set[str]] = {}
    for name in datasets.SIMULATED:
        (command,) = datasets.dataset_commands(tmp_path / f"{name}-4096")
        words = command.arguments.split()
        options = dict(pairwise(words))
        seed = options.get("--seed", "0")
        scenes = options.get("--scenes")
        settings_for(
            options["--preset"],
            int(seed),
            None,
            None if scenes is None else int(scenes),
            (),
            options.get("--sensor", "none"),
        )
        assert options["--prepared"] == f"{options['--out']}-4096"
        seeds.setdefault(seed, set()).add("test" if name.startswith("test-") else "train")
    assert all(len(roles) == 1 for roles in seeds.values()), "no scene is both trained and tested"
    seeds_of = {
        name: {datasets.SIMULATED[part].split("--seed ")[1].split()[0] for part in parts}
        for name, parts in datasets.JOINED.items()
    }
    assert not seeds_of["mixture"] & seeds_of["more-mixture"]


def test_a_joined_data_set_is_made_of_its_parts_once(tmp_path: Path) -> None:
    *parts, join = datasets.dataset_commands(tmp_path / "more-mixture-1024")
    assert all("--points 1024" in part.arguments for part in parts)
    assert [f"data/{part.prepared.name}" for part in parts] == join.arguments.split()[1:-2]
    assert join.arguments.endswith("--out data/more-mixture-1024")
    (tmp_path / "mixture-4096").mkdir()
    (tmp_path / "mixture-4096" / "dataset.json").touch()
    assert list(datasets.dataset_commands(tmp_path / "mixture-4096")) == []


def test_a_published_run_is_repeated(small_dataset: PreparedDataset, folders: Path) -> None:
    path = folders / "experiments" / "trial.toml"
    path.write_text(
        f'dataset = "{small_dataset.folder}"\nnetworks = ["pointnet"]\nnum_points = 128\n'
        '[recipe_changes]\nepochs = 1\nbatch_size = 8\nprecision = "fp32"\ncoarse_to_fine = []\n'
    )
    compare(load_experiment(path, {}), folders / "runs" / "trial")
    publish("trial")
    published.comparison.cache_clear()
    now, before, allowed = run.repeat_run("pointnet", 3, "trial")
    published.comparison.cache_clear()
    assert now == pytest.approx(before)
    assert allowed >= 2 / 12
