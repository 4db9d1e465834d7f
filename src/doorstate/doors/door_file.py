# SPDX-License-Identifier: Apache-2.0
"""Lists of doors as YAML files: read with the line of every problem, written, and lengthened without other changes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from pydantic import ValidationError

from doorstate._files import write_text
from doorstate._input import MAX_SETTINGS_BYTES, read_input_text
from doorstate.doors.named_door import DoorList, NamedDoor
from doorstate.errors import DoorFileError
from doorstate.io.located_yaml import Key, LocatedYaml, LocatedYamlError, parse_located_yaml

_OVERLAP_M = 0.15  # that two openings in one wall may share: errors of their places
_SAME_WALL_M, _SAME_WALL_DEG = 0.3, 20.0
_INDENT = "  "
_HEADER = """\
# Doors of a map. Poses: middle of the opening and direction of the wall towards its left, seen from the front.
"""


class Problem(NamedTuple):
    """Something in a list of doors that cannot be used."""

    line: int
    field: str  # such as doors[2].width_m; empty for the file
    message: str

    def __str__(self) -> str:
        place = f"line {self.line}: {self.field}: " if self.field else f"line {self.line}: "
        return place + self.message


def read_doors(path: Path) -> DoorList:
    """Read a list of doors.

    Raises:
        DoorFileError: the file cannot be read, or its first problem.
    """
    doors, problems = check_doors(read_input_text(path, MAX_SETTINGS_BYTES, DoorFileError))
    if doors is None or problems:
        first = problems[0]
        raise DoorFileError(f"line {first.line}: {first.message}", path=path, field=first.field or None)
    return doors


def check_doors(text: str) -> tuple[DoorList | None, list[Problem]]:
    """Return the list of a YAML text, and all its problems by line; without a list where fields are wrong."""
    try:
        located = parse_located_yaml(text)
    except LocatedYamlError as error:
        return None, [Problem(error.line, "", error.message)]
    value = located.value
    if isinstance(value, dict):
        value = _with_frames(value)
    try:
        doors = DoorList.model_validate(value)
    except ValidationError as error:
        # A missing field of a union is reported for each of its types.
        found = {_problem(located, problem): None for problem in error.errors()}
        return None, sorted(found)
    return doors, sorted(_conflicts(located, doors.doors))


def write_doors(path: Path, doors: DoorList) -> None:
    """Write a list of doors; a file of that name is replaced.

    Raises:
        OutputError: it cannot be written.
    """
    items = _items(doors.doors, doors.frame, "")
    write_text(path, f"{_HEADER}version: 1\nframe: {_scalar(doors.frame)}\ndoors:{items or ' []'}\n")


def add_doors(path: Path, new: Sequence[NamedDoor]) -> DoorList:
    """Add doors at the end of a list, whose lines and comments stay as they are; without the file, make it.

    Returns:
        All doors of the file.

    Raises:
        DoorFileError: the list cannot be read, would have a problem, or is not written door by door below `doors:`.
        OutputError: it cannot be written.
    """
    if not path.exists():
        frame = new[0].frame if new else DoorList().frame
        doors = DoorList(frame=frame, doors=tuple(new))
        write_doors(path, doors)
        return read_doors(path)
    text = read_input_text(path, MAX_SETTINGS_BYTES, DoorFileError)
    before = read_doors(path)
    if not new:
        return before
    if not before.doors:
        text = "\n".join(
            line for line in text.splitlines() if line.replace(" ", "") not in ("doors:[]", "doors:")
        )
        text = f"{text}\ndoors:"
    last = next((line for line in reversed(text.splitlines()) if line.lstrip().startswith("- ")), "")
    indent = last[: len(last) - len(last.lstrip())]
    text = text.rstrip() + _items(new, before.frame, indent) + "\n"
    after, problems = check_doors(text)
    if after is None or after.doors != (*before.doors, *new):
        raise DoorFileError(
            "no door can be added at its end",
            path=path,
            field="doors",
            expected="a list at the end of the file, one line that begins with - for each door",
        )
    if problems:
        raise DoorFileError(problems[0].message, path=path, field=problems[0].field)
    write_text(path, text)
    return after


def _items(doors: Sequence[NamedDoor], frame: str, indent: str) -> str:
    """Return doors as lines of YAML, each line after a line break."""
    lines = []
    for door in doors:
        fields = door.model_dump(exclude_defaults=True, mode="json") | {"id": door.id}
        if door.frame != frame:
            fields["frame"] = door.frame
        else:
            fields.pop("frame", None)
        mark = "- "
        for name, value in fields.items():
            lines.append(f"\n{indent}{mark}{name}: {_scalar(value)}")
            mark = _INDENT
    return "".join(lines)


def _scalar(value: Any) -> str:
    """Return a value in one line of YAML, quoted where another reader would take it for something else."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{name}: {_scalar(item)}" for name, item in value.items()) + "}"
    text: str = yaml.safe_dump(value, allow_unicode=True, width=math.inf, default_flow_style=True)
    return text.removesuffix("\n").removesuffix("\n...")


def _with_frames(content: dict[str, Any]) -> dict[str, Any]:
    """Return the content with the frame of the list in every door that names none."""
    doors, frame = content.get("doors"), content.get("frame")
    if not isinstance(doors, list) or frame is None:
        return {name: value for name, value in content.items() if value is not None}
    filled = [{"frame": frame} | _given(door) if isinstance(door, dict) else door for door in doors]
    return content | {"doors": filled}


def _given(door: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in door.items() if value is not None or name != "frame"}


def _problem(located: LocatedYaml, problem: Any) -> Problem:
    key: Key = tuple(part for part in problem["loc"] if isinstance(part, int) or "[" not in part)
    own = problem.get("ctx", {}).get("error")
    message = str(own or problem["msg"])
    if problem["type"] == "extra_forbidden":
        message = "no such field"
    elif problem["type"] == "missing":
        message = "is missing"
    return Problem(located.line_of(key), _field(key), message[:1].lower() + message[1:])


def _field(key: Key) -> str:
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in key)
    return text.removeprefix(".")


def _conflicts(located: LocatedYaml, doors: Sequence[NamedDoor]) -> Iterator[Problem]:
    """Yield names that two doors have, and doors at one place."""
    for number, door in enumerate(doors):
        for other in doors[:number]:
            if door.id.casefold() == other.id.casefold():
                key: Key = ("doors", number, "id")
                yield Problem(located.line_of(key), _field(key), f"another door is called {other.id!r}")
            elif overlap(door, other):
                key = ("doors", number, "pose")
                yield Problem(located.line_of(key), _field(key), f"overlaps the door {other.id!r}")


def overlap(door: NamedDoor, other: NamedDoor) -> bool:
    """Return True for two doors at one place of one wall, seen from either side."""
    if door.frame != other.frame:
        return False
    reach_m, near_wall_m = (door.width_m + other.width_m) / 2, max(_SAME_WALL_M, door.wall_m, other.wall_m)
    if abs(door.pose.x_m - other.pose.x_m) > reach_m + near_wall_m:  # most pairs, at little cost
        return False
    seen = door.place.inverse().after(other.place)
    turn_deg = abs(math.remainder(seen.yaw_deg, 180.0))
    return (
        turn_deg <= _SAME_WALL_DEG and abs(seen.y_m) <= near_wall_m and abs(seen.x_m) < reach_m - _OVERLAP_M
    )
