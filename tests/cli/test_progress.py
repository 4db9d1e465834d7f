# SPDX-License-Identifier: Apache-2.0
"""Progress bars and lines."""

from __future__ import annotations

import io
import time

import pytest
from rich.console import Console

from doorstate.cli import console, progress


def test_short_work_prints_nothing_without_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with progress.progress_bar("Working") as update:
        update(1, 2)
    with progress.working("Thinking"):
        pass
    assert capsys.readouterr() == ("", "")


def test_bar_is_drawn_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Console(file=io.StringIO(), force_terminal=True, width=80)
    monkeypatch.setattr(console, "stderr", screen)
    with progress.progress_bar("Working") as update:
        update(3, 7)
    assert isinstance(screen.file, io.StringIO)
    assert "Working" in screen.file.getvalue()
    assert "3/7" in screen.file.getvalue()


def test_lines_come_at_growing_intervals(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "FIRST_LINE_S", 2.0)
    now = 0.0
    update = progress.line_progress("Working", lambda: now)
    lines = []
    for done in range(1, 501):
        now = float(done)
        update(done, 500)
        if capsys.readouterr().err:
            lines.append(done)
    assert lines == [2, 4, 8, 16, 32, 64, *range(124, 500, 60)]


def test_line_tells_the_time_left(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "FIRST_LINE_S", 2.0)
    times = iter([0.0, 10.0])
    progress.line_progress("Working", lambda: next(times))(5, 25)
    assert capsys.readouterr().err == "Working: 5 of 25, about 40 s left\n"


def test_work_of_unknown_length_prints_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "FIRST_LINE_S", 0.01)
    errors, end_s = "", time.monotonic() + 30
    with progress.working("Thinking"):
        while "\n" not in errors and time.monotonic() < end_s:
            time.sleep(0.05)
            errors += capsys.readouterr().err
        time.sleep(0.05)
    assert errors + capsys.readouterr().err == "Thinking ...\n"


@pytest.mark.parametrize(("seconds", "text"), [(40, "40 s"), (720, "12 min"), (12600, "3.5 h")])
def test_times_are_short(seconds: float, text: str) -> None:
    assert progress.duration(seconds) == text
