# SPDX-License-Identifier: Apache-2.0
"""A second process on an output folder is told the first; a terminated one says so and leaves no lock behind."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from doorstate import _locks
from doorstate._files import is_scratch
from doorstate.dataset.store import PreparedDataset
from tests.cli.helpers import Run, check_error
from tests.test__locks import hold

_COMMAND = [sys.executable, "-c", "from doorstate.cli import main; main()"]


def _arguments(command: str, data: Path, raw: Path, out: Path) -> list[Any]:
    """Return the arguments of a command that takes long."""
    match command:
        case "simulate":
            return ["--preset", "varied", "--scenes", 900, "--workers", 1, "--out", out]
        case "prepare":
            return [raw, "--points", 9000, "--workers", 1, "--out", out]
        case "train":
            return ["--network", "pointnet", "--data", data, "--points", 128, "--epochs", 900, "--out", out]
    names = ["--network", "pointnet", "--folds", 1, "--points", 128, "--epochs", 900]
    return ["--data", data, *names, "--out", out]


@pytest.mark.parametrize("command", ["simulate", "prepare", "train", "compare"])
def test_a_folder_has_one_owner(
    command: str, run: Run, small_dataset: PreparedDataset, simulated_folder: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    arguments = _arguments(command, small_dataset.folder, simulated_folder, out)
    line = [*_COMMAND, command, *map(str, arguments)]
    first = subprocess.Popen(line, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    try:
        deadline = time.monotonic() + 120
        while not (out / ".doorstate.owner").is_file():
            assert time.monotonic() < deadline
            assert first.poll() is None
            time.sleep(0.02)
        check_error(run(command, *arguments), 1, f"process {first.pid} on ")
        assert first.poll() is None, "the first one goes on"
        first.send_signal(signal.SIGTERM)
        _, errors = first.communicate(timeout=120)
    finally:
        first.kill()
        first.wait()
    assert first.returncode == -signal.SIGTERM
    assert errors.splitlines()[-1].startswith("doorstate: terminated")
    assert "Traceback" not in errors
    assert [path for path in out.rglob("*") if is_scratch(path)] == []


@pytest.mark.parametrize("command", ["evaluate", "report"])
def test_results_of_two_commands_are_not_mixed(
    command: str,
    run: Run,
    small_dataset: PreparedDataset,
    simulated_folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(_locks, "_WAIT_S", 0.2)
    source = {
        "evaluate": [simulated_folder / "pcd", "--rule", "plane_state"],
        "report": [small_dataset.folder],
    }
    first = hold(tmp_path / "out")
    try:
        check_error(run(command, *source[command], "--out", tmp_path / "out"), 1, f"process {first.pid} on ")
    finally:
        first.kill()
        first.communicate()
    assert [path for path in (tmp_path / "out").iterdir() if not is_scratch(path)] == []
