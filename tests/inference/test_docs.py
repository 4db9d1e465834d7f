# SPDX-License-Identifier: Apache-2.0
"""The Python of docs/deployment.md runs as it stands."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
EXAMPLES = re.findall(
    r"```python\n(.*?)```", (DOCS / "deployment.md").read_text(encoding="utf-8"), flags=re.DOTALL
)
PRINTED = (
    r"^open \{'closed'",
    r"^hole$",
    r"^\d+ points fit into 33 ms\n(<DoorState.OPEN: 2> \n){4}$",
    r"^None since 0\.0 s(.*\n)*<DoorState.OPEN: 2> since 0\.[1-9] s",
    r"^the way is free$",
)
LIVE = 4  # number of the example with a camera that may stop sending


@pytest.fixture(scope="module")
def recording(simulated_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A robot that stands before an open door for two seconds."""
    folder = tmp_path_factory.mktemp("robot")
    (folder / "recording").mkdir()
    cloud = sorted((simulated_folder / "pcd" / "open").glob("*.pcd"))[0]
    (folder / "cloud.pcd").symlink_to(cloud)
    for number in range(20):
        (folder / "recording" / f"{number:02d}.pcd").symlink_to(cloud)
    return folder


def run_example(number: int) -> None:
    exec(compile(EXAMPLES[number], f"docs/deployment.md, example {number + 1}", "exec"), {})


def test_every_example_is_run_here() -> None:
    assert len(EXAMPLES) == len(PRINTED)


@pytest.mark.parametrize("number", range(len(PRINTED)))
def test_the_example_runs(
    number: int, recording: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(recording)
    run_example(number)
    assert re.search(PRINTED[number], capsys.readouterr().out, flags=re.MULTILINE)


def test_a_silent_camera_ends_the_wait(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    run_example(LIVE)
    assert capsys.readouterr().out == "not open, or no more frames: ask for help\n"
