# SPDX-License-Identifier: Apache-2.0
"""The coverage-guided fuzzer, with a stand-in for atheris, which not every Python has: it tries what it is given."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rosbags")

REPOSITORY = Path(__file__).resolve().parents[1]
ATHERIS = """
import contextlib, os, pathlib

def instrument_imports(include):
    return contextlib.nullcontext()

def Setup(arguments, attempt):
    global given
    given = arguments, attempt

def Fuzz():
    (_, *options, last), attempt = given
    if "-hang" in options:
        from benchmarks.fuzzer import Fuzzer
        Fuzzer.judge = lambda *_: ("hang", "2 s")
    files = sorted(pathlib.Path(last).glob("*"))
    for file in files[:20]:
        attempt(file.read_bytes())
    print(len(files), [option for option in options if option.startswith("-artifact")], flush=True)
    os._exit(0)
"""


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    (tmp_path / "atheris.py").write_text(ATHERIS)
    return os.environ | {"PYTHONPATH": str(tmp_path), "OMP_NUM_THREADS": "1"}


def guided(environment: dict[str, str], *arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "benchmarks.guided", *map(str, arguments)]
    return subprocess.run(
        command, cwd=REPOSITORY, env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize("target", [".mcap", "PointCloud2"])
def test_a_target_begins_with_inputs_of_its_own(
    target: str, tmp_path: Path, environment: dict[str, str]
) -> None:
    done = guided(environment, target, tmp_path / "kept", "-runs=20")
    name = target.strip(".").replace(" ", "-")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"100 ['-artifact_prefix={tmp_path}/kept/{name}-']\n"
    assert len(list((tmp_path / "kept" / name).iterdir())) == 100


def test_what_fails_is_said_and_the_exit_code(tmp_path: Path, environment: dict[str, str]) -> None:
    done = guided(environment, "camera file", tmp_path / "kept", "-hang")
    assert done.returncode == 1
    assert "Failure: hang: 2 s" in done.stderr


def test_another_target_is_refused_with_all_there_are(tmp_path: Path, environment: dict[str, str]) -> None:
    done = guided(environment, ".obj", tmp_path)
    assert done.returncode == 1
    assert "Targets: .pcd, " in done.stderr
