# SPDX-License-Identifier: Apache-2.0
"""Values of docs/commands.md: the options of all commands."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import typer

from doorstate.cli.application import app
from doorstate.cli.choices import fill_in


class Option(NamedTuple):
    """Option of one command."""

    command: str
    flag: str
    text: str


class SharedOption(NamedTuple):
    """Option with the same meaning in several commands."""

    flag: str
    commands: list[str]
    text: str


def content() -> Mapping[str, Any]:
    """Return the values of the page."""
    options = list(list_options())
    shared = [option for option in share_options(options) if len(option.commands) > 1]
    single: dict[str, list[Option]] = {}
    for option in options:
        if not any(option.flag == other.flag and option.command in other.commands for other in shared):
            single.setdefault(option.command, []).append(option)
    return {"shared": shared, "single": single, "summaries": summaries()}


def summaries() -> dict[str, str]:
    """Return the first line of the help of each command."""
    return {
        name: (command.help or "").strip().partition("\n")[0] for name, command in named_commands().items()
    }


def list_options() -> Iterator[Option]:
    """Yield the options of all commands; arguments have none."""
    for name, command in named_commands().items():
        for parameter in command.params:
            flag = parameter.opts[0]
            if flag.startswith("--") and flag != "--help":
                yield Option(name, flag, fill_in(" ".join((getattr(parameter, "help", "") or "").split())))


def share_options(options: list[Option]) -> list[SharedOption]:
    """Return the options by flag and meaning, in order of appearance."""
    commands: dict[tuple[str, str], list[str]] = {}
    for option in options:
        commands.setdefault((option.flag, option.text), []).append(option.command)
    return [SharedOption(flag, names, text) for (flag, text), names in commands.items()]


def named_commands() -> dict[str, Any]:
    """Return the commands by name; those of a group as `group command`."""
    commands: dict[str, Any] = {}
    for name, command in typer.main.get_command(app).commands.items():  # type: ignore[attr-defined]
        members = getattr(command, "commands", None)
        if members is None:
            commands[name] = command
        else:
            commands |= {f"{name} {member}": inner for member, inner in members.items()}
    return commands
