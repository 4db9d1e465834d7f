# SPDX-License-Identifier: Apache-2.0
"""Live display of training runs."""

from __future__ import annotations

import io
import re
import time
from pathlib import Path

import pytest
from rich.console import Console

from doorstate.cli import run_display
from doorstate.cli.run_display import RunDisplay, live_runs
from doorstate.training.comparison import RunSpec
from doorstate.training.recipes import CoarseStage, Recipe
from doorstate.training.run_folder import RunFolder

RECIPE = Recipe(name="x", epochs=10, coarse_to_fine=(CoarseStage(share=0.5, points=256),))
RECIPES = {"pointnet": RECIPE, "dgcnn": RECIPE}


def started(folder: Path) -> RunFolder:
    run = RunFolder(folder)
    run.write_log([{"epoch": n, "points": 256, "centres": 1, "seconds": 30.0} for n in range(2)])
    run.write_position(2.5)
    return run


def finished(folder: Path) -> RunFolder:
    run = RunFolder(folder)
    points = [256] * 5 + [512] * 5
    run.write_log([{"epoch": n, "points": p, "centres": 1, "seconds": p / 16} for n, p in enumerate(points)])
    run.finish({"test_macro_f1": 0.98765, "seconds": 600.0})
    return run


def table_text(runs: list[RunSpec], jobs: int) -> str:
    screen = Console(file=io.StringIO(), width=100)
    screen.print(RunDisplay(runs, RECIPES, 512, jobs).table())
    assert isinstance(screen.file, io.StringIO)
    return screen.file.getvalue()


def minutes(text: str) -> list[float]:
    units = {"s": 1 / 60, "min": 1, "h": 60}
    found = re.findall(r"about\s+([\d.]+)\s+(s|min|h)\s+left", " ".join(text.split()))
    return [round(float(number) * units[unit], 1) for number, unit in found]


def test_table_shows_scores_progress_and_time_left(tmp_path: Path) -> None:
    runs = [
        RunSpec("pointnet", 0, finished(tmp_path / "a")),
        RunSpec("pointnet", 1, RunFolder(tmp_path / "b")),
        RunSpec("dgcnn", 0, started(tmp_path / "c")),
        RunSpec("dgcnn", 1, RunFolder(tmp_path / "d")),
    ]
    text = table_text(runs, jobs=1)
    assert "0.9877" in text
    assert "2.5 / 10" in text
    # PointNet: 5 epochs of 16 s and 5 of 32 s. DGCNN: 2.5 and 5 epochs of 30 s, then 5 and 5 of an estimated 60 s.
    assert minutes(text) == [18]
    assert minutes(table_text(runs, jobs=2)) == [9]
    assert minutes(table_text(runs, jobs=9)) == [6]  # three are left


def test_no_time_left_before_the_first_epoch(tmp_path: Path) -> None:
    assert minutes(table_text([RunSpec("dgcnn", 0, RunFolder(tmp_path / "d"))], jobs=1)) == []


def test_run_without_a_test_is_done(tmp_path: Path) -> None:
    run = RunFolder(tmp_path)
    run.finish({"seconds": 1.0})
    assert "done" in table_text([RunSpec("pointnet", 0, run)], jobs=1)


def test_without_a_terminal_finished_runs_are_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with live_runs([RunSpec("dgcnn", 0, started(tmp_path))], RECIPES, 512, 1) as progress:
        progress(1, 4)
    err = capsys.readouterr().err
    assert err.startswith("1 of 4 ")
    assert (err.count("\n"), minutes(err)) == (1, [6])


def test_without_a_terminal_each_new_epoch_is_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_display, "_LOOK_PERIOD_S", 0.01)
    run = started(tmp_path)
    with live_runs([RunSpec("dgcnn", 3, run)], RECIPES, 512, 1):
        time.sleep(0.1)
        assert capsys.readouterr().err == "", "epochs of an earlier start are not repeated"
        entries = [
            {"epoch": n, "points": 256, "centres": 1, "train_loss": 0.5, "seconds": 30.0} for n in range(4)
        ]
        run.write_log(entries)
        errors, end_s = "", time.monotonic() + 30
        while errors.count("\n") < 2 and time.monotonic() < end_s:
            time.sleep(0.05)
            errors += capsys.readouterr().err
    lines = (errors + capsys.readouterr().err).splitlines()
    assert [line.partition(",")[0] for line in lines] == ["dgcnn", "dgcnn"]
    assert ["3 of 10" in lines[0], "4 of 10" in lines[1]] == [True, True]
    assert all("fold 3" in line and "0.500" in line and "\x1b" not in line for line in lines)
