# SPDX-License-Identifier: Apache-2.0
"""The page "Your doors in an hour" on a simulated bag: from labels to predictions of the exported weights."""

from __future__ import annotations

import json
import re
import runpy
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rosbags")

from doorstate._files import read_csv
from doorstate.dataset.frame_labels import LabelIndex
from doorstate.io.options import ReadOptions
from doorstate.training.adaptation import simulated
from doorstate.training.adaptation import weights as adapted_weights
from doorstate.training.adaptation.simulated import SimulatedPart
from doorstate.viewer.frame_sources import BagFrames
from doorstate.viewer.label_session import GivenLabels, LabelSession
from tests.cli.helpers import Run

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "your-doors.md").read_text(encoding="utf-8")
COMMANDS = [
    shlex.split(line)[1:]
    for block in re.findall(r"^```console\n(.*?)^```", PAGE, flags=re.DOTALL | re.MULTILINE)
    for line in block.splitlines()
]
SMALL = {
    "adapt": ("--epochs", 1, "--set", "batch_size=8", "--set", "clouds_per_epoch=16", "--workers", 1),
    "export": ("--clouds", 3),
    "predict": ("--json",),
}
PART = SimulatedPart("varied", "none", 2, 1)


def press_keys(bag: Path, folder: Path, angle_of: Callable[[float], float]) -> int:
    """Label every second frame as the keys do, those between two states excepted; return the labels."""
    source = BagFrames(bag, folder, ReadOptions(pitch_deg=0.0), None, None, 2)
    session = LabelSession(source, LabelIndex(folder, ()))
    for number in range(len(source.names)):
        angle_deg = angle_of(2 * number / 5)  # five frames a second
        state = next((name for name, low, high in STATES if low <= angle_deg <= high), None)
        if state is not None:
            session.show(number)
            session.save(number, GivenLabels.model_validate({"labels": [{"state": state}]}))
    source.close()
    return session.labelled


STATES = (("closed", 0, 3), ("semi_open", 15, 65), ("open", 75, 90))


@pytest.fixture
def door_bag(tmp_path: Path) -> tuple[Path, Callable[[float], float]]:
    example = runpy.run_path(str(ROOT / "examples" / "make_bag.py"))
    example["main"](tmp_path / "door-bag")
    return tmp_path / "door-bag", example["opening_angle_deg"]


@pytest.mark.slow
def test_every_command_of_the_page_runs(
    door_bag: tuple[Path, Callable[[float], float]],
    run: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(simulated, "DOORWAYS", ((PART,), (PART,)))
    monkeypatch.setattr(adapted_weights, "MOST_FORGOTTEN", 1.0)
    assert [command[0] for command in COMMANDS] == [
        "label",
        "evaluate",
        "adapt",
        "evaluate",
        "export",
        "predict",
    ]
    printed: dict[str, Any] = {}
    for name, *arguments in COMMANDS:
        if name == "label":
            assert press_keys(door_bag[0], tmp_path / "door-bag-labels", door_bag[1]) >= 10
            continue
        code, out, error = run(name, *arguments, *SMALL.get(name, ()))
        assert code == 0, f"{name}: {error}"
        printed[name] = out
    assert {row["state"] for row in read_csv(tmp_path / "door-bag-labels" / "index.csv")} == {
        "closed",
        "semi_open",
        "open",
    }
    assert (tmp_path / "report" / "frames.html").is_file()
    assert (tmp_path / "site.md").is_file()
    rows = [json.loads(line) for line in printed["predict"].splitlines()]
    assert len(rows) == 8
    assert rows[0]["state"] == "closed"
