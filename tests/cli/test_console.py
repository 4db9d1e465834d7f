# SPDX-License-Identifier: Apache-2.0
"""What is shown while things run."""

from __future__ import annotations

import io
import time
from pathlib import Path

import pytest
from rich.console import Console

from doorstate.cli import console, run_display
from doorstate.training.comparison import RunSpec
from doorstate.training.recipes import Recipe, Stage
from doorstate.training.run_folder import RunFolder

RECIPE = Recipe(name="x", epochs=10, coarse_to_fine=(Stage(share=0.5, points=256),))
RECIPES = {"pointnet": RECIPE, "dgcnn": RECIPE}


def begun(folder: Path) -> RunFolder:
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


def shown(runs: list[RunSpec], jobs: int) -> str:
    screen = Console(file=io.StringIO(), width=100)
    screen.print(run_display.RunDisplay(runs, RECIPES, 512, jobs).table())
    assert isinstance(screen.file, io.StringIO)
    return screen.file.getvalue()


def test_the_live_table_says_what_is_done_and_how_long_the_rest_takes(tmp_path: Path) -> None:
    runs = [
        RunSpec("pointnet", 0, finished(tmp_path / "a")),
        RunSpec("pointnet", 1, RunFolder(tmp_path / "b")),
        RunSpec("dgcnn", 0, begun(tmp_path / "c")),
        RunSpec("dgcnn", 1, RunFolder(tmp_path / "d")),
    ]
    text = shown(runs, jobs=1)
    assert "0.9877" in text
    assert "2.5 / 10" in text
    # PointNet: 5 epochs of 16 s and 5 of 32 s. DGCNN: 2.5 and 5 of 30 s, then 5 and 5 that nobody has seen, of 60 s.
    assert "about 18 min left" in text
    assert "about 9 min left" in shown(runs, jobs=2)


def test_without_a_finished_epoch_nothing_is_promised(tmp_path: Path) -> None:
    text = shown([RunSpec("dgcnn", 0, RunFolder(tmp_path / "d"))], jobs=1)
    assert "left" not in text


def test_where_nobody_looks_finished_runs_are_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with run_display.live_runs([RunSpec("dgcnn", 0, RunFolder(tmp_path))], RECIPES, 512, 1) as progress:
        progress(1, 4)
    assert capsys.readouterr().err == "1 of 4 runs finished\n"
    with run_display.live_runs([RunSpec("dgcnn", 0, begun(tmp_path))], RECIPES, 512, 1) as progress:
        progress(1, 4)
    assert capsys.readouterr().err == "1 of 4 runs finished, about 6 min left\n"


def test_a_log_hears_of_long_runs_before_they_end(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_display, "_LINE_PERIOD_S", 0.01)
    with run_display.live_runs([RunSpec("dgcnn", 0, begun(tmp_path))], RECIPES, 512, 1):
        time.sleep(0.1)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) > 1
    assert set(lines) == {"0 of 1 runs finished, about 6 min left"}


def test_a_run_that_tested_nothing_is_done(tmp_path: Path) -> None:
    run = RunFolder(tmp_path)
    run.finish({"seconds": 1.0})
    assert "done" in shown([RunSpec("pointnet", 0, run)], jobs=1)


def test_bars_print_nothing_where_nobody_looks(capsys: pytest.CaptureFixture[str]) -> None:
    with console.progress_bar("Working") as progress:
        progress(1, 2)
    assert capsys.readouterr() == ("", "")


def test_bars_are_drawn_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Console(file=io.StringIO(), force_terminal=True, width=80)
    monkeypatch.setattr(console, "stderr", screen)
    with console.progress_bar("Working") as progress:
        progress(3, 7)
    assert isinstance(screen.file, io.StringIO)
    assert "Working" in screen.file.getvalue()
    assert "3/7" in screen.file.getvalue()
