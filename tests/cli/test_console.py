# SPDX-License-Identifier: Apache-2.0
"""Progress bars and tables."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from doorstate.cli import console


def test_progress_bar_prints_nothing_without_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with console.progress_bar("Working") as progress:
        progress(1, 2)
    assert capsys.readouterr() == ("", "")


def test_progress_bar_is_drawn_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Console(file=io.StringIO(), force_terminal=True, width=80)
    monkeypatch.setattr(console, "stderr", screen)
    with console.progress_bar("Working") as progress:
        progress(3, 7)
    assert isinstance(screen.file, io.StringIO)
    assert "Working" in screen.file.getvalue()
    assert "3/7" in screen.file.getvalue()


def test_table_prints_markup_literally(capsys: pytest.CaptureFixture[str]) -> None:
    console.print_table("", ["file", "points"], [["[red]x", "12"]])
    assert "[red]x" in capsys.readouterr().out
