# SPDX-License-Identifier: Apache-2.0
"""JSON and TOML of users and of other programs: bounded in bytes, depth and the size of integers.

The parsers alone are not safe: nesting ends in RecursionError, and so does whatever walks deep content later (dotted
keys of TOML nest without recursion); an integer of thousands of digits, hexadecimal in TOML, cannot even be printed.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from doorstate._input import MAX_SETTINGS_BYTES, read_input_text
from doorstate.errors import ConfigError, DoorstateError, RunError, summarize_exception

MAX_RESULTS_BYTES = 1 << 26  # of the metrics and epoch logs of a study
MAX_DEPTH = 50
_MAX_INTEGER = 2**63 - 1
_DEEP_KEY = re.compile(rf"""(?<![\w"'-])(?:[\w"'-]++[ \t]*+\.[ \t]*+){{{MAX_DEPTH}}}""")


def read_json(
    path: Path, error: type[DoorstateError] = RunError, max_bytes: int = MAX_RESULTS_BYTES
) -> dict[str, Any]:
    """Return the JSON object of a file.

    Args:
        path: a regular file.
        error: class of the error.
        max_bytes: largest size of the file.

    Raises:
        DoorstateError: of class `error`, with the path: missing, too large, no JSON object, or nested too deeply.
    """
    value = _located(lambda: parse_json(read_input_text(path, max_bytes, error), error), path)
    if not isinstance(value, dict):
        raise error("holds no JSON object", path=path)
    return value


def parse_json(text: str, error: type[DoorstateError] = RunError) -> Any:
    """Return the value of a JSON text.

    Raises:
        DoorstateError: of class `error`: no JSON, nested too deeply, or an integer of more than 64 bits.
    """
    return _parse(json.loads, text, "JSON", error)


def read_toml(path: Path, error: type[DoorstateError] = ConfigError) -> dict[str, Any]:
    """Return the content of a TOML file; arguments and errors are those of `read_json`."""
    content: dict[str, Any] = _located(
        lambda: parse_toml(read_input_text(path, MAX_SETTINGS_BYTES, error), error), path
    )
    return content


def parse_toml(text: str, error: type[DoorstateError] = ConfigError) -> dict[str, Any]:
    """Return the content of a TOML text; errors are those of `parse_json`."""
    if _DEEP_KEY.search(text):  # the parser takes quadratic time
        raise error("is nested too deeply for TOML", expected=f"at most {MAX_DEPTH} levels")
    content: dict[str, Any] = _parse(tomllib.loads, text, "TOML", error)
    return content


def _parse(parse: Callable[[str], Any], text: str, kind: str, error: type[DoorstateError]) -> Any:
    try:
        value = parse(text)
    except RecursionError as problem:
        raise error(f"is nested too deeply for {kind}", expected=f"at most {MAX_DEPTH} levels") from problem
    except (json.JSONDecodeError, tomllib.TOMLDecodeError) as problem:
        raise error(f"cannot be read as {kind} ({summarize_exception(problem)})") from problem
    except ValueError as problem:
        raise error("holds an integer of thousands of digits", expected="64 bits or less") from problem
    _check_content(value, error)
    return value


def _check_content(value: Any, error: type[DoorstateError]) -> None:
    level, depth = [value], 0
    while level:
        if depth == MAX_DEPTH:
            raise error("is nested too deeply", expected=f"at most {MAX_DEPTH} levels")
        for item in level:
            if isinstance(item, int) and not -_MAX_INTEGER <= item <= _MAX_INTEGER:
                raise error("holds an integer of more than 64 bits")
        level = [inner for item in level for inner in _inner(item)]
        depth += 1


def _inner(item: Any) -> Any:
    return item.values() if isinstance(item, dict) else item if isinstance(item, list) else ()


def _located(read: Callable[[], Any], path: Path) -> Any:
    try:
        return read()
    except DoorstateError as error:
        raise error if error.path is not None else error.located(path) from error
