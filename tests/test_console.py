# SPDX-License-Identifier: Apache-2.0
"""What is shown while things run."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from rich.console import Console

from doorstate import console
from doorstate.training.comparison import Run
from doorstate.training.run_folder import RunFolder

EPOCHS = {"pointnet": 10, "dgcnn": 10}


def begun(folder: Path) -> RunFolder:
    run = RunFolder(folder)
    run.write_log([{"epoch": 0, "seconds": 60.0}, {"epoch": 1, "seconds": 30.0}])
    run.write_position(2.5)
    return run


def finished(folder: Path) -> RunFolder:
    run = RunFolder(folder)
    run.finish({"test_macro_f1": 0.98765, "seconds": 600.0})
    return run


def shown(runs: list[Run], jobs: int) -> str:
    screen = Console(file=io.StringIO(), width=100)
    screen.print(console._RunWatch(runs, EPOCHS, jobs).table())
    assert isinstance(screen.file, io.StringIO)
    return screen.file.getvalue()


def test_the_live_table_says_what_is_done_and_how_long_the_rest_takes(tmp_path: Path) -> None:
    runs = [
        Run("pointnet", 0, finished(tmp_path / "a")),
        Run("pointnet", 1, RunFolder(tmp_path / "b")),
        Run("dgcnn", 0, begun(tmp_path / "c")),
        Run("dgcnn", 1, RunFolder(tmp_path / "d")),
    ]
    text = shown(runs, jobs=1)
    assert "0.9877" in text
    assert "2.5 / 10" in text
    # PointNet: 10 epochs of 60 s; DGCNN: 7.5 and 10 of 30 s.
    assert "about 19 min left" in text
    assert "about 9 min left" in shown(runs, jobs=2)


def test_without_a_finished_epoch_nothing_is_promised(tmp_path: Path) -> None:
    text = shown([Run("dgcnn", 0, RunFolder(tmp_path / "d"))], jobs=1)
    assert "left" not in text


def test_where_nobody_looks_finished_runs_are_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with console.live_runs([Run("dgcnn", 0, RunFolder(tmp_path))], EPOCHS, 1) as progress:
        progress(1, 4)
    assert capsys.readouterr().err == "1 of 4 runs finished\n"


def test_bars_print_nothing_where_nobody_looks(capsys: pytest.CaptureFixture[str]) -> None:
    with console.progress_bar("Working") as progress:
        progress(1, 2)
    assert capsys.readouterr() == ("", "")


def test_bars_are_drawn_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Console(file=io.StringIO(), force_terminal=True, width=80)
    monkeypatch.setattr(console, "err", screen)
    with console.progress_bar("Working") as progress:
        progress(3, 7)
    assert isinstance(screen.file, io.StringIO)
    assert "Working" in screen.file.getvalue()
    assert "3/7" in screen.file.getvalue()
