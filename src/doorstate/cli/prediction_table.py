# SPDX-License-Identifier: Apache-2.0
"""Table of `doorstate predict`: a row as soon as it is known, and its reason below it."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from rich.text import Text

from doorstate._paths import printable
from doorstate.cli import console
from doorstate.pages.plan import plan_of_record
from doorstate.pages.plan_text import SIGN_WIDTH, ascii_only, door_sign, plan_text
from doorstate.types import ABSTAINED

STATE_STYLES = {"closed": "red", "semi_open": "yellow", "open": "green"}
_MISSING = "-"
_GAP = "  "
_NARROWEST_NAME = 12


class _Column(NamedTuple):
    title: str
    width: int
    cell: Callable[[dict[str, Any]], str]


def _number(name: str, pattern: str) -> Callable[[dict[str, Any]], str]:
    """Return a function of a row that formats a value; answers without a state have none."""

    def cell(row: dict[str, Any]) -> str:
        value = row.get(name)
        return _MISSING if value is None or row["state"] is None else pattern.format(value)

    return cell


def _probability(row: dict[str, Any]) -> str:
    probabilities = row.get("probabilities")
    return f"{probabilities[row['state']]:.2f}" if probabilities and row["state"] else _MISSING


def _distance(row: dict[str, Any]) -> str:
    door = (row.get("doors") or [row])[0]
    if "distance_m" in door:
        return f"{door['distance_m']:.2f} m"
    if row["state"] is None or row.get("door_x_m") is None:
        return _MISSING
    return f"{math.hypot(row['door_x_m'], row['door_y_m']):.2f} m"


def _milliseconds(row: dict[str, Any]) -> str:
    return f"{row['milliseconds']:.0f}" if "milliseconds" in row else ""


def side_of(bearing_deg: float) -> str:
    """Return the direction of a door in words."""
    degrees = round(abs(bearing_deg))
    return "ahead" if degrees == 0 else f"{degrees}° {'left' if bearing_deg > 0 else 'right'}"


_COLUMNS = (
    _Column("prob.", 5, _probability),
    _Column("angle", 5, _number("opening_angle_deg", "{:.0f}°")),
    _Column("passable", 8, _number("passable_width_m", "{:.2f} m")),
    _Column("distance", 8, _distance),
    _Column("ms", 5, _milliseconds),
)
_STATE_WIDTH = 9
_CELLS_WIDTH = (
    2 * len(_GAP) + SIGN_WIDTH + _STATE_WIDTH + sum(len(_GAP) + column.width for column in _COLUMNS)
)


def door_drawing(doors: Sequence[dict[str, Any]]) -> list[Text]:
    """Return all doors from above, the robot at the foot, and what is known of each beside them.

    Args:
        doors: doors as `door_to_dict` returns them; no lines where the output has no signs.
    """
    if not _has_signs():
        return []
    drawing = plan_text(plan_of_record(doors))
    notes = [note for number, door in enumerate(doors, 1) for note in _notes(number, door, len(doors))]
    lines = []
    for row in range(max(len(drawing.lines), len(notes))):
        blank = " " * len(drawing.lines[0])
        line = Text("  " + (drawing.lines[row] if row < len(drawing.lines) else blank))
        for mark in drawing.marks:
            if mark.row == row:
                style = STATE_STYLES.get(doors[mark.door]["state"], "bold")
                line.stylize(style, mark.column + 2, mark.column + 2 + mark.length)
        if row < len(notes):
            line.append(_GAP + notes[row][0], notes[row][1])
        line.rstrip()
        lines.append(line)
    return lines


class PredictionTable:
    """Prints predictions on standard output.

    Args:
        title: of the first column, such as "file".
        names: names of the first column, as far as they are known; they fit into it where the output is no terminal.
        methods: names of the methods; several are listed below the name of each cloud.
        draws: draw the doors from above below each cloud.
    """

    def __init__(
        self, title: str, names: Sequence[str], methods: Sequence[str], *, draws: bool = False
    ) -> None:
        self._draws = draws
        self._by_method = len(methods) > 1
        self._title = title
        self._width = console.stdout.width if console.stdout.is_terminal else None
        labels = (
            [*(f"  {method}" for method in methods)] if self._by_method else [printable(n) for n in names]
        )
        longest = max(map(len, [title, *labels]), default=0)
        room = longest if self._width is None else max(_NARROWEST_NAME, self._width - _CELLS_WIDTH)
        self._name_width = min(longest, room)
        self._last_name: str | None = None

    def add(self, name: str, row: dict[str, Any]) -> None:
        """Print a prediction.

        Args:
            name: file, or time stamp of a message.
            row: prediction by `prediction_values`, with its `method`.
        """
        if self._last_name is None:
            self._print_titles()
        if self._by_method and name != self._last_name:
            console.stdout.print(name, style="bold")
        self._last_name = name
        self._print_answer(f"  {row['method']}" if self._by_method else printable(name), row)
        indent = "    " if self._by_method else "  "
        doors = row.get("doors", ())
        is_named = "named_doors" in row
        for number, door in enumerate(doors if is_named else doors[1:], 1 if is_named else 2):
            name = printable(door["name"]) if is_named else f"door {number}"
            long, short = f"{indent}{name}, {_signs(side_of(door['bearing_deg']))}", f"{indent}{name}"
            if not is_named:
                short = f"{indent}{number}"
            self._print_answer(long if len(long) <= self._name_width else short, door)
        for line in not_seen_lines(row.get("named_doors", ())):
            self._print_reason(printable(line))
        if self._draws and doors:
            for drawn in door_drawing(doors):
                console.stdout.print(drawn)

    def _print_answer(self, name: str, answer: dict[str, Any]) -> None:
        """Print a prediction, or one of its further doors."""
        line = Text(_fit(name, self._name_width))
        state = answer["state"]
        line.append(f"{_GAP}{state or ABSTAINED:<{_STATE_WIDTH}}", STATE_STYLES.get(state, "bold"))
        line.append(_GAP + _signs(door_sign(state, answer.get("hinge"))))
        for column in _COLUMNS:
            line.append(f"{_GAP}{_signs(column.cell(answer)):>{column.width}}")
        console.stdout.print(line)
        if reason := answer.get("reason"):
            self._print_reason(printable(reason))

    def _print_titles(self) -> None:
        titles = [
            f"{self._title:<{self._name_width}}",
            f"{'state':<{_STATE_WIDTH}}",
            f"{'door':<{SIGN_WIDTH}}",
        ]
        titles += [f"{column.title:>{column.width}}" for column in _COLUMNS]
        console.stdout.print(_GAP.join(titles), style="bold underline")

    def _print_reason(self, reason: str) -> None:
        indent = "    " if self._by_method else "  "
        lines = [indent + reason]
        if self._width is not None:
            lines = textwrap.wrap(
                reason, self._width, initial_indent=indent, subsequent_indent=indent, break_long_words=False
            )
        for line in lines:
            console.stdout.print(line, style="dim")


def not_seen_lines(sightings: Sequence[dict[str, Any]]) -> list[str]:
    """Return lines for the doors of a list that this cloud does not show: one for those with the same reason."""
    names: dict[str, list[str]] = {}
    for sighting in sightings:
        if not sighting["seen"]:
            names.setdefault(sighting.get("reason", ""), []).append(sighting["id"])
        elif sighting.get("asked"):
            answer = sighting["state"] or sighting.get("reason", ABSTAINED)
            names.setdefault(f"{answer}, asked for at its place", []).append(sighting["id"])
    return [f"{', '.join(ids)}: {reason}" for reason, ids in names.items()]


def _notes(number: int, door: dict[str, Any], count: int) -> list[tuple[str, str]]:
    """Return lines about a door beside the drawing, with their style."""
    label = printable(door["name"]) if "name" in door else str(number) if count > 1 else ""
    state = door["state"]
    head = f"{label}  {state or ABSTAINED}".strip()
    if (angle_deg := door.get("opening_angle_deg")) is not None and state not in (None, "closed"):
        head += f" {angle_deg:.0f}°"
    lines = [(head, STATE_STYLES.get(state, "bold"))]
    lines.append((f"  {door['distance_m']:.2f} m, {side_of(door['bearing_deg'])}", ""))
    if state is not None and (passable_m := door.get("passable_width_m")) is not None:
        lines.append((f"  {passable_m:.2f} m of {door['width_m']:.2f} m free", ""))
    return lines


def _has_signs() -> bool:
    """Return True if the output can show signs beyond ASCII."""
    return (console.stdout.encoding or "").lower().startswith("utf")


def _signs(text: str) -> str:
    return text if _has_signs() else ascii_only(text)


def _fit(name: str, width: int) -> str:
    """Return a name of this width; the end of a long one tells more than its beginning."""
    return f"{name:<{width}}" if len(name) <= width else f"…{name[1 - width :]}"
