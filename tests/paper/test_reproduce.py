# SPDX-License-Identifier: Apache-2.0
"""Published tables, figures and pages are what the committed predictions give."""

from __future__ import annotations

import json
import tomllib
from contextlib import nullcontext
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from doorstate.dataset.splits import Role, write_splits
from doorstate.dataset.store import PreparedDataset, open_dataset
from doorstate.simulation.settings import settings_for
from doorstate.training.comparison import compare
from doorstate.training.experiment import load_experiment
from doorstate.training.run_folder import RunFolder
from paper import reproduce as module

REPOSITORY = Path(__file__).parents[2]


@pytest.fixture
def reproduce() -> ModuleType:
    return module


@pytest.mark.slow
def test_everything_published_follows_from_the_committed_predictions(reproduce: ModuleType) -> None:
    assert reproduce.check() is None


def test_publishing_takes_what_is_small_of_finished_runs(
    reproduce: ModuleType, small_dataset: PreparedDataset, tmp_path: Path
) -> None:
    source = tmp_path / "runs"
    for fold in (0, 1):
        run = RunFolder(source / "runs" / "pointnet" / f"fold{fold}")
        run.claim({"network": "pointnet"}, {"python": "3"})
        run.path.joinpath("weights.safetensors").write_bytes(b"large")
        run.path.joinpath("checkpoint.pt").write_bytes(b"larger")
    RunFolder(source / "runs" / "pointnet" / "fold1").finish({"test_macro_f1": 1.0})
    tested = [row["sample_id"] for row in small_dataset.rows[3:9]]
    roles: dict[str, Role] = {row["sample_id"]: "train" for row in small_dataset.rows}
    write_splits(source / "splits.csv", [roles | dict.fromkeys(tested, "test"), dict.fromkeys(roles, "test")])
    (source / "comparison.json").write_text(json.dumps({"dataset": str(small_dataset.folder), "folds": 1}))
    (source / "report").mkdir()
    (source / "report" / "report.html").write_text("made anew")
    target = tmp_path / "results" / "trial"
    reproduce.publish(source, target)
    rows = open_dataset(tmp_path / "results" / small_dataset.folder.name)
    assert [row["sample_id"] for row in rows.rows] == tested
    assert np.array_equal(rows.cloud(0), small_dataset.cloud(3)), "replayed"
    published = [path for path in target.rglob("*") if path.is_file()]
    names = sorted(str(path.relative_to(target)) for path in published)
    folder = "runs/pointnet/fold1"
    assert names == [
        "comparison.json",
        *(f"{folder}/{name}" for name in ("config.json", "environment.json", "metrics.json")),
        "splits.csv",
    ]


def test_what_is_published_is_restored_with_the_weights_of_the_package(
    reproduce: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, config in (("pointnet2", {"network": "pointnet2"}), ("plane_state", {"rule": "plane_state"})):
        run = RunFolder(tmp_path / "results" / "trial" / "runs" / name / "fold0")
        run.claim(config, {})
        run.finish({})
    (tmp_path / "results" / "trial" / "report").mkdir()
    monkeypatch.setattr(reproduce, "RESULTS", tmp_path / "results")
    monkeypatch.setattr(reproduce, "RUNS", tmp_path / "runs")
    reproduce.main(["restore", "trial", "ogurob-"])
    assert [str(path.parent.relative_to(tmp_path)) for path in tmp_path.rglob("*.safetensors")] == [
        "runs/trial/runs/pointnet2/fold0"
    ]
    assert not (tmp_path / "runs" / "trial" / "report").exists()
    assert RunFolder(tmp_path / "runs" / "trial" / "runs" / "plane_state" / "fold0").finished
    with pytest.raises(SystemExit, match="is there already"):
        reproduce.main(["restore", "trial"])


def test_folds_that_all_methods_have_finished_are_shown(reproduce: ModuleType, tmp_path: Path) -> None:
    from paper.pages.results import unfinished_runs, whole_folds

    (tmp_path / "comparison.json").write_text('{"networks": ["dgcnn"], "rules": ["angle_bins"], "folds": 3}')
    shown = []
    for method, fold in (
        ("dgcnn", 0),
        ("dgcnn", 1),
        ("angle_bins", 0),
        ("angle_bins", 2),
        ("angle_bins", 1),
        ("dgcnn", 2),
    ):
        RunFolder(tmp_path / "runs" / method / f"fold{fold}").finish({})
        shown.append(whole_folds(tmp_path))
    assert shown == [0, 0, 1, 1, 2, 3]
    assert unfinished_runs(tmp_path) == []


@pytest.mark.parametrize(
    "path", sorted(REPOSITORY.glob("paper/experiments/*.toml")), ids=lambda path: path.stem
)
def test_an_experiment_comes_after_its_data_and_what_it_begins_with(
    path: Path, reproduce: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from paper import datasets as data_sets

    called: list[str] = []
    monkeypatch.setattr(reproduce, "RUNS", tmp_path)
    monkeypatch.setattr(reproduce, "doorstate", lambda arguments, makes=None: called.append(arguments))
    monkeypatch.setattr(
        reproduce, "commands", lambda folder: [data_sets.Command(f"make {folder.name}", folder)]
    )
    reproduce.run(path.stem)
    made = [line.removeprefix("make ") for line in called if line.startswith("make ")]
    asked = tomllib.loads(path.read_text())
    needed = [
        *(asked.get("tested", {}).values() or [asked["dataset"]]),
        *asked.get("extra_train_datasets", []),
    ]
    assert {Path(each).name for each in needed} <= set(made)
    (own,) = (number for number, line in enumerate(called) if f"/{path.name}" in line)
    for before in asked.get("trained", {}).values() or filter(None, [asked.get("start_from")]):
        (number,) = (
            n
            for n, line in enumerate(called)
            if f"compare paper/experiments/{Path(before).name}.toml" in line
        )
        assert number < own


@pytest.mark.parametrize(
    ("exit_code", "made", "goes_on"), [(0, True, True), (1, True, True), (1, False, False), (2, True, False)]
)
def test_a_data_set_of_which_some_clouds_were_left_out_is_gone_on_with(
    exit_code: int,
    made: bool,
    goes_on: bool,
    reproduce: ModuleType,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    from paper import commands as doorstate_command
    from paper import datasets as data_sets

    program = tmp_path / "doorstate"
    program.write_text(
        f'#!/bin/sh\necho "$1" >> {tmp_path}/called\ntest "$1" != simulate || exit {exit_code}\n'
    )
    program.chmod(0o755)
    if made:
        (tmp_path / "dataset.json").touch()
    monkeypatch.setattr(doorstate_command.sys, "executable", str(tmp_path / "python"))
    monkeypatch.setattr(reproduce, "commands", lambda folder: [data_sets.Command("simulate", tmp_path)])
    with nullcontext() if goes_on else pytest.raises(SystemExit):
        reproduce.run("by-pose")
    called = (tmp_path / "called").read_text().split()
    assert called == (["simulate", "compare", "report"] if goes_on else ["simulate"])


def test_what_an_experiment_begins_with_is_not_run_again_once_it_is_there(
    reproduce: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    called: list[str] = []
    monkeypatch.setattr(reproduce, "doorstate", lambda arguments, makes=None: called.append(arguments))
    monkeypatch.setattr(reproduce, "commands", lambda folder: [])
    monkeypatch.setattr(reproduce, "RUNS", tmp_path)
    folder = tmp_path / "mixture-longer"
    folder.mkdir()
    (folder / "comparison.json").write_text('{"networks": ["pointnet2"], "rules": [], "folds": 1}')
    for finished in (False, True):
        if finished:
            RunFolder(folder / "runs" / "pointnet2" / "fold0").finish({})
        called.clear()
        reproduce.run("mixture-wide")
        assert any("mixture-longer.toml" in line for line in called) is not finished
        assert any("mixture-wide.toml" in line for line in called)


def test_data_sets_are_made_of_what_the_command_line_knows(reproduce: ModuleType, tmp_path: Path) -> None:
    from paper import datasets as data_sets

    seeds: dict[str, set[str]] = {}
    for name in data_sets.SIMULATED:
        (simulate,) = data_sets.commands(tmp_path / f"{name}-4096")
        words = simulate.arguments.split()
        seed = words[words.index("--seed") + 1] if "--seed" in words else "0"
        preset = words[words.index("--preset") + 1]
        scenes = words[words.index("--scenes") + 1] if "--scenes" in words else None
        sensor = words[words.index("--sensor") + 1] if "--sensor" in words else "none"
        settings_for(preset, int(seed), None, None if scenes is None else int(scenes), (), sensor)
        assert words[words.index("--prepared") + 1] == f"{words[words.index('--out') + 1]}-4096"
        seeds.setdefault(seed, set()).add("test" if name.startswith("test-") else "train")
    assert all(len(uses) == 1 for uses in seeds.values()), "no scene is trained and tested on"
    seeds_of = {
        mixture: {data_sets.SIMULATED[part].split("--seed ")[1].split()[0] for part in parts}
        for mixture, parts in data_sets.JOINED.items()
    }
    assert not seeds_of["mixture"] & seeds_of["more-mixture"], "what is learned besides is tested nowhere"
    *parts, join = data_sets.commands(tmp_path / "mixture-4096")
    made = [line.arguments.split()[line.arguments.split().index("--prepared") + 1] for line in parts]
    assert made == join.arguments.split()[1:-2]
    *parts, join = data_sets.commands(tmp_path / "more-mixture-1024")
    assert all("--points 1024" in part.arguments for part in parts)
    assert [f"data/{part.makes.name}" for part in parts] == join.arguments.split()[1:-2]
    assert join.arguments.endswith("--out data/more-mixture-1024")
    (tmp_path / "mixture-4096").mkdir()
    (tmp_path / "mixture-4096" / "dataset.json").touch()
    assert list(data_sets.commands(tmp_path / "mixture-4096")) == []


@pytest.mark.parametrize("arguments", [[], ["run"], ["check", "now"], ["publish"], ["sell", "paper"]])
def test_wrong_usage_shows_how(reproduce: ModuleType, arguments: list[str]) -> None:
    with pytest.raises(SystemExit, match=r"reproduce\.py run paper"):
        reproduce.main(arguments)


def test_a_published_run_is_trained_again(
    reproduce: ModuleType,
    small_dataset: PreparedDataset,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "trial.toml").write_text(
        f'dataset = "{small_dataset.folder}"\nnetworks = ["pointnet"]\nnum_points = 128\n'
        '[recipe_changes]\nepochs = 1\nbatch_size = 8\nprecision = "fp32"\ncoarse_to_fine = []\n'
    )
    compare(load_experiment(tmp_path / "trial.toml", {}), tmp_path / "trial")
    for name in ("RESULTS", "RUNS", "EXPERIMENTS"):
        monkeypatch.setattr(reproduce, name, tmp_path)
    assert reproduce.again("pointnet", 3, "trial") is None
    assert "pointnet, fold 3: " in capsys.readouterr().out
    published = RunFolder(tmp_path / "trial" / "runs" / "pointnet" / "fold3")
    found = published.read_metrics()
    spread = 2 / found["test_samples"]
    for off, inside in ((0.9 * spread, True), (-5.0, False)):
        published.finish(found | {"test_macro_f1": found["test_macro_f1"] + off})
        for fold in (0, 1, 2, 4):  # as if all folds were alike, so that chance alone is allowed for
            other = RunFolder(tmp_path / "trial" / "runs" / "pointnet" / f"fold{fold}")
            other.finish(other.read_metrics() | {"test_macro_f1": found["test_macro_f1"] + off})
        assert (reproduce.again("pointnet", 3, "trial") is None) is inside
    published.metrics.unlink()
    assert "not all folds of pointnet are published" in reproduce.again("pointnet", 3, "trial")
