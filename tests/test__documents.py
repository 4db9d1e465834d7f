# SPDX-License-Identifier: Apache-2.0
"""JSON and TOML are read or refused with the path, whatever they hold."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from doorstate._documents import MAX_DEPTH, parse_json, parse_toml, read_json, read_toml
from doorstate.errors import ConfigError, DatasetError, RunError

_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63) + 1, 2**63 - 1) | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=20,
)


@given(_VALUES)
def test_ordinary_json_is_read_as_written(value: object) -> None:
    assert parse_json(json.dumps(value)) == value


@pytest.mark.parametrize(
    "text",
    ["[" * 100_000, '{"a":' * 100_000, "1" * 5000, "1" * 400, f"-{2**63}0", "", "{", "\ud800"],
)
def test_hostile_json_is_refused(text: str) -> None:
    with pytest.raises(RunError):
        parse_json(text)


@pytest.mark.parametrize(
    "text",
    [
        "a = " + "[" * 5000,
        "a = " + "{b = " * 5000,
        "a = " + "1" * 5000,
        "a = 0x" + "f" * 10_000,  # hexadecimal integers have no limit in Python, and cannot be printed
        ".".join("a" * 3000) + " = 1",  # nests without recursion
        f"[{'.'.join('a' * 3000)}]",
        "a = 1\na = 2",
    ],
)
def test_hostile_toml_is_refused(text: str) -> None:
    with pytest.raises(ConfigError) as refused:
        parse_toml(text)
    assert str(refused.value).isprintable()


def test_the_depth_has_a_limit() -> None:
    deepest = "[" * MAX_DEPTH + "]" * MAX_DEPTH
    assert json.dumps(parse_json(deepest)) == deepest
    with pytest.raises(RunError):
        parse_json(f"[{deepest}]")


def test_errors_have_the_class_of_the_caller_and_the_path(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    for content in (b"[1]", b"{", b"\xff\xfe", b'{"a": ' + b"9" * 30 + b"}"):
        path.write_bytes(content)
        with pytest.raises(DatasetError) as refused:
            read_json(path, DatasetError)
        assert refused.value.path == path
    for missing in (tmp_path / "b.json", tmp_path):
        with pytest.raises(RunError) as refused_run:
            read_json(missing)
        assert refused_run.value.path == missing
    (tmp_path / "a.toml").write_text("a =")
    with pytest.raises(ConfigError) as refused_toml:
        read_toml(tmp_path / "a.toml")
    assert refused_toml.value.path == tmp_path / "a.toml"


def test_sizes_are_checked_before_reading(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.touch()
    os.truncate(path, 200 << 30)  # a sparse file
    for read, error in ((read_toml, ConfigError), (read_json, RunError)):
        with pytest.raises(error):
            read(path)
    (tmp_path / "a.json").write_text("{}")
    assert read_json(tmp_path / "a.json", max_bytes=2) == {}
    with pytest.raises(RunError):
        read_json(tmp_path / "a.json", max_bytes=1)


def test_pipes_are_refused_without_waiting(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.json")
    with pytest.raises(RunError):
        read_json(tmp_path / "a.json")


def test_keys_of_thousands_of_parts_are_refused_at_once() -> None:
    started = time.process_time()
    for text in (
        "a." * 500_000 + "b = 1",
        "[" + "a . " * 500_000 + "b]",
        '"a".' * 200_000 + "b = 1",
        "a" * 1_000_000,
    ):
        with pytest.raises(ConfigError):
            parse_toml(text)
    assert time.process_time() - started < 2
    assert parse_toml(f"x = '{'a.' * 30}'\n{'a.' * 30}b = 0.1") is not None
