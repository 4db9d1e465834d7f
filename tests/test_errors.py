# SPDX-License-Identifier: Apache-2.0
"""Errors: one printable line for every surface, fields kept across processes."""

from __future__ import annotations

import pickle
from pathlib import Path

from doorstate.errors import MAX_MESSAGE_LENGTH, CloudReadError, ConfigError


def as_flag(name: str, value: object) -> str:
    return f"--{name}" if value is None else f"--{name} {value}"


def test_surfaces_write_parameters_in_their_own_way() -> None:
    error = ConfigError("too few", field="points", expected="128 or more", suggestions={"points": 128})
    assert str(error) == "points: too few; expected 128 or more; try points=128"
    assert error.describe(as_flag) == "--points: too few; expected 128 or more; try --points 128"


def test_a_key_of_a_file_is_written_as_in_the_file() -> None:
    error = ConfigError("no number", path=Path("a.toml"), field="num_points", hint="write digits")
    assert error.describe(as_flag) == "a.toml: num_points: no number; write digits"
    assert error.describe(with_path=False) == "num_points: no number; write digits"


def test_fields_survive_processes_and_a_later_path() -> None:
    error = CloudReadError("truncated", field="width", suggestions={"frame": "optical"})
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is CloudReadError
    assert (copy.message, copy.field, copy.suggestions) == (error.message, error.field, error.suggestions)
    located = error.located("b.pcd")
    assert (located.path, located.field) == ("b.pcd", "width")


def test_a_line_is_printable_and_short() -> None:
    line = str(ConfigError("a\nb\x1b[31m" + "x" * 5000))
    assert line.isprintable()
    assert len(line) == MAX_MESSAGE_LENGTH
