# SPDX-License-Identifier: Apache-2.0
"""Tables, and text that must not be obeyed."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from doorstate.cli import console

HOSTILE = "a\x1b[31m\x9b2J\x07\u202eb\udcff\n"


def test_table_prints_markup_literally(capsys: pytest.CaptureFixture[str]) -> None:
    console.print_table("", ["file", "points"], [["[red]x", "12"]])
    assert "[red]x" in capsys.readouterr().out


def test_terminal_escapes_are_printed_as_text(capsys: pytest.CaptureFixture[str]) -> None:
    console.stdout.print(HOSTILE)
    console.print_table(HOSTILE, ["file"], [[HOSTILE]])
    out = capsys.readouterr().out
    assert all(character.isprintable() or character == "\n" for character in out)
    assert r"a\x1b[31m\x9b2J\x07\u202eb\udcff" in out


def test_lines_are_not_wrapped(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    line = "next: doorstate prepare " + "long/" * 30 + "folder --out x"
    console.stdout.print(line)
    assert capsys.readouterr().out == line + "\n"


@given(st.text())
def test_json_lines_are_printable_and_keep_the_text(text: str) -> None:
    line = console.json_line({"file": text})
    assert json.loads(line) == {"file": text}
    assert not any(0x7F <= ord(c) <= 0x9F or ord(c) < 0x20 or 0xD800 <= ord(c) <= 0xDFFF for c in line)
