# SPDX-License-Identifier: Apache-2.0
"""Help, exit codes and errors of the command line."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.cli.helpers import Run, check_error

COMMANDS = (
    "simulate",
    "prepare",
    "join",
    "train",
    "adapt",
    "compare",
    "report",
    "resolution",
    "transfer",
    "predict",
    "label",
    "evaluate",
    "view",
    "serve",
    "export",
    "export-sdf",
    "info",
)


def test_help_imports_no_large_packages() -> None:
    large = ("torch", "numpy", "pandas", "scipy", "sklearn", "pydantic", "matplotlib", "jinja2", "fastapi")
    script = f"import sys, doorstate.cli; print([name for name in {large} if name in sys.modules])"
    assert subprocess.check_output([sys.executable, "-c", script], text=True).strip() == "[]"


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_each_command_has_examples(command: str, run: Run) -> None:
    code, out, _ = run(command, "--help")
    assert code == 0
    assert f"doorstate {command}" in out.partition("Example")[2].partition("Options:")[0]


def test_help_lists_all_commands(run: Run) -> None:
    code, out, _ = run("--help")
    assert code == 0
    listed = [line.split()[0] for line in out.partition("Commands:")[2].splitlines() if line.startswith("  ")]
    assert [name for name in listed if name in COMMANDS] == list(COMMANDS)


def test_unknown_options_and_commands_are_exit_code_2(run: Run) -> None:
    assert run("predict", "--nonsense", "x")[0] == 2
    assert run("predct")[0] == 2


@pytest.mark.parametrize(
    ("arguments", "expected_code", "name"),
    [
        (["predict", "gone.pcd"], 1, "gone.pcd"),
        (["predict", ".", "--roll", "450"], 2, "450"),
        (["predict", ".", "--fx", "-5", "--fy", "5", "--cx", "2", "--cy", "2"], 2, "fx"),
        (["view", ".", "--rule", "plane_state", "--network", "pointnet2"], 2, "plane_state"),
        (["serve", "--network", "pointnet2", "--weights", "x.safetensors"], 2, "pointnet2, x"),
        (["export", "--network", "pointnet2,ogurob-dgcnn"], 2, "ogurob-dgcnn"),
        (["predict", ".", "--rule", "plane_state,Plane-State"], 2, "plane_state"),
        (["predict", ".", "--network", "dgcnn"], 2, "'ogurob-dgcnn'"),
        (["predict", ".", "--rule", "plane_state", "--points", "1024"], 2, "points"),
        (["predict", ".", "--points", "512", "--budget-ms", "33"], 2, "budget"),
        (["predict", ".", "--rule", "plane_state", "--budget-ms", "33"], 2, "budget"),
        (["predict", ".", "--out", "cloud.npy/x.csv"], 1, "cloud.npy/x.csv"),
        (["predict", ".", "--out", "states.txt"], 2, "--out states.txt"),
        (["view", ".", "--out", "cloud.npy/x.html"], 1, "cloud.npy/x.html"),
        (["export", "--out", "cloud.npy/x.onnx"], 1, "cloud.npy/x.onnx"),
        (["export", "--out", "x.pb"], 2, "--out x.pb"),
        (["simulate", "--out", "x", "--poses", "0"], 2, "--poses"),
        (["predict", ".", "--units", "furlongs"], 2, "furlongs"),
        (["predict", ".", "--axes", "sideways"], 2, "sideways"),
        (["predict", ".", "--network", "pointnett"], 2, "pointnett"),
        (["predict", ".", "--weights", "gone.safetensors"], 1, "gone.safetensors"),
        (["simulate", "--out", "x", "--preset", "mars"], 2, "mars"),
        (["simulate", "--out", "x", "--poses", "9999"], 2, "1353"),
        (["simulate", "--out", "x", "--keep", "video"], 2, "video"),
        (["simulate", "--out", "x", "--preset", "varied", "--poses", "3"], 2, "scenes"),
        (["simulate", "--out", "x", "--scenes", "3"], 2, "poses"),
        (["simulate", "--out", "x", "--shard", "3/2"], 2, "--shard"),
        (["simulate", "--out", "x", "--thin"], 2, "--prepared"),
        (["prepare", "gone", "--out", "x"], 1, "gone"),
        (["prepare", "gone", "--out", "x", "--layout", "deepdoor"], 2, "'deepdoors2'"),
        (["compare", "--data", "x", "--protocol", "by-pos"], 2, "'by-pose'"),
        (["train", "--network", "pointnet", "--data", "gone", "--out", "x"], 1, "gone"),
        (["train", "--network", "poinnet", "--data", "gone", "--out", "x"], 2, "'pointnet'"),
        (["compare"], 2, "--data"),
        (["compare", "gone.toml"], 2, "gone.toml"),
        (["compare", "--data", "gone", "--set", "epochs"], 2, "--set epochs"),
        (["report", "gone"], 1, "gone"),
    ],
)
def test_errors_are_one_line(
    arguments: list[str],
    expected_code: int,
    name: str,
    run: Run,
    tmp_path: Path,
    cloud: np.ndarray,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    np.save("cloud.npy", cloud)
    check_error(run(*arguments), expected_code, name)
    assert not Path("x").exists(), "a refused command leaves no folder"


def test_interrupt_is_exit_code_130(run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("doorstate.simulation.writer.simulate_dataset", interrupted)
    code, _, err = run("simulate", "--out", tmp_path / "x", "--poses", 1)
    assert code == 130  # some versions of typer handle the key themselves
    assert "Traceback" not in err
