# SPDX-License-Identifier: Apache-2.0
"""All commands together: options that mean the same, examples that can be typed, and words of the right surface."""

from __future__ import annotations

import ast
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from paper.pages.commands import list_options, named_commands, share_options

import doorstate
from doorstate.cli.flags import format_flag
from doorstate.serving.request import PredictQuery, format_parameter

SOURCE = Path(doorstate.__file__).parent
COMMANDS: dict[str, Any] = named_commands()
# Options that name another thing in other commands, and say so in their help.
SEVERAL_MEANINGS = {
    *("--out", "--seed", "--workers", "--points", "--network", "--data", "--port"),
    *("--poses", "--doors", "--weights"),
}
RAISING = re.compile(r"(Error|missing_extra|unknown_name|error|Abstention)$")
_FLAG = re.compile(r"(^|\W)--[a-z]")
_COMMAND = re.compile(r"doorstate (" + "|".join(COMMANDS) + r")\b")
_CODE = re.compile(r"\w\([\w\"']*\)|\w=\w")


def test_an_option_means_the_same_in_all_commands() -> None:
    meanings: dict[str, int] = {}
    for option in share_options(list(list_options())):
        meanings[option.flag] = meanings.get(option.flag, 0) + 1
    assert {flag for flag, count in meanings.items() if count > 1} == SEVERAL_MEANINGS


def test_every_option_is_explained_with_its_names_filled_in() -> None:
    for option in list_options():
        assert option.text, option
        assert "{" not in option.text, option


def examples() -> Iterator[tuple[str, list[str]]]:
    for name, command in COMMANDS.items():
        for line in command.help.splitlines():
            if line.strip().startswith("doorstate "):
                yield name, shlex.split(line)[1:]


@pytest.mark.parametrize(("name", "words"), list(examples()))
def test_examples_of_the_help_are_accepted(name: str, words: list[str]) -> None:
    command, arguments = words[0], words[1:]
    if command not in COMMANDS:
        command, arguments = f"{command} {words[1]}", words[2:]
    assert command in COMMANDS
    with COMMANDS[command].make_context(command, arguments) as context:
        assert context.params


def texts_of_errors() -> Iterator[tuple[Path, int, str]]:
    """Yield the literal texts of all errors that the library raises, and of reasons to abstain."""
    for path in sorted(SOURCE.rglob("*.py")):
        if "cli" in path.relative_to(SOURCE).parts:
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call):
                name = getattr(node.func, "id", getattr(node.func, "attr", ""))
                if RAISING.search(name):
                    for part in ast.walk(node):
                        if isinstance(part, ast.Constant) and isinstance(part.value, str):
                            yield path.relative_to(SOURCE), part.lineno, part.value


def test_errors_of_the_library_name_no_flag_no_command_and_no_code() -> None:
    texts = list(texts_of_errors())
    assert len(texts) > 500
    for pattern in (_FLAG, _COMMAND, _CODE):
        assert [text for text in texts if pattern.search(text[2])] == []


def suggested_parameters() -> set[str]:
    names = set()
    for path in SOURCE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if (
                isinstance(node, ast.keyword)
                and node.arg == "suggestions"
                and isinstance(node.value, ast.Dict)
            ):
                names |= {key.value for key in node.value.keys if isinstance(key, ast.Constant)}
    return {name for name in names if isinstance(name, str)}


def test_suggestions_are_options_that_exist() -> None:
    flags = {option.flag for option in list_options()}
    names = suggested_parameters()
    assert {"axes", "units_m", "num_points"} <= names
    assert {format_flag(name) for name in names} <= flags


def test_no_surface_names_the_parameters_of_another() -> None:
    for name in ("axes", "units_m", "depth_scale_m", "roll_deg", "pitch_deg"):
        assert format_flag(name).startswith("--")
        assert format_parameter(name) in PredictQuery.model_fields
