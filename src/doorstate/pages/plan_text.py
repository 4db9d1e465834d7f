# SPDX-License-Identifier: Apache-2.0
"""Plans in characters: one sign for a door, and a drawing of all doors in dots of Braille, two by four a character."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from doorstate.pages.plan import Place, Plan, PlanDoor
from doorstate.types import ABSTAINED, Hinge

SIGN_WIDTH = 7
_BRAILLE = 0x2800
# Bits of the dots of a character by row and column; Unicode Standard, block Braille Patterns.
_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
_ROBOT = "▲"
_JAMB_M = 0.12
_LABEL = 12  # characters
_LEAVES: dict[str, dict[Hinge | None, str]] = {
    "closed": dict.fromkeys((None, "left", "right"), "━━━"),
    "semi_open": {None: " ╱ ", "left": "╲  ", "right": "  ╱"},
    "open": {None: "   ", "left": "│  ", "right": "  │"},
    ABSTAINED: dict.fromkeys((None, "left", "right"), " ? "),
}
_ASCII = str.maketrans(
    {"━": "=", "─": "-", "╱": "/", "╲": "\\", "│": "|", "┨": "[", "┠": "]", "…": "~", "°": None}
)


class Mark(NamedTuple):
    """Characters of a drawing that belong to one door, for its colour."""

    row: int
    column: int
    length: int
    door: int


class TextPlan(NamedTuple):
    """Drawing of a plan in lines of equal length."""

    lines: tuple[str, ...]
    marks: tuple[Mark, ...]


def door_sign(state: str | None, hinge: Hinge | None = None) -> str:
    """Return a door from above in seven characters: wall, frame and leaf, which turns to the robot below.

    Args:
        state: name of the state; None without one.
        hinge: side of the hinge; None where it is not known.
    """
    return f"─┨{_LEAVES[state or ABSTAINED][hinge]}┠─"


def ascii_only(text: str) -> str:
    """Return signs in ASCII, for outputs that have no other characters."""
    return text.translate(_ASCII)


def plan_text(plan: Plan, columns: int = 34, most_rows: int = 12) -> TextPlan:
    """Return a plan in characters; the robot at its foot looks up. Wall, leaf and swing are dots.

    Args:
        plan: plan.
        columns: length of a line.
        most_rows: number of lines, at most.
    """
    canvas = _Canvas(plan, columns, most_rows)
    for start, end in plan.walls:
        canvas.draw(start, end)
    marks: list[Mark] = []
    for number, door in enumerate(plan.doors):
        before = dict(canvas.cells)
        for first, last in _strokes(door):
            canvas.draw(first, last)
        changed = sorted(cell for cell, dots in canvas.cells.items() if before.get(cell) != dots)
        marks += (Mark(row, column, 1, number) for row, column in changed)
    lines = canvas.lines()
    row, column = canvas.cell((0.0, 0.0))
    _write(lines, row, column, _ROBOT)
    for number, door in enumerate(plan.doors):
        if door.label:
            marks.append(_label(lines, canvas, door, number))
    return TextPlan(tuple("".join(line) for line in lines), tuple(marks))


class _Canvas:
    """Dots that are drawn, by the character they are in."""

    def __init__(self, plan: Plan, columns: int, most_rows: int) -> None:
        xs, ys = zip(*plan.places, strict=True)
        self._far, self._left = max(*xs, 1.0), max(*ys, 0.6)
        depth_m, width_m = self._far - min(*xs, -0.1), self._left - min(*ys, -0.6)
        self.columns = columns
        self._per_m = min((2 * columns - 1) / width_m, (4 * most_rows - 1) / depth_m)
        self.rows = min(most_rows, math.ceil((depth_m * self._per_m + 1) / 4))
        # The drawing stands in the middle of its lines.
        self._shift = (2 * columns - 1 - width_m * self._per_m) / 2
        self.cells: dict[tuple[int, int], int] = {}

    def dot(self, place: Place) -> tuple[int, int]:
        """Return row and column of a place's dot."""
        x, y = place
        return round((self._far - x) * self._per_m), round((self._left - y) * self._per_m + self._shift)

    def cell(self, place: Place) -> tuple[int, int]:
        """Return row and column of a place's character, inside of the drawing."""
        row, column = self.dot(place)
        return min(max(0, row // 4), self.rows - 1), min(max(0, column // 2), self.columns - 1)

    def draw(self, start: Place, end: Place) -> None:
        """Draw a line; dots outside of the drawing are left out."""
        (row, column), (last_row, last_column) = self.dot(start), self.dot(end)
        steps = max(abs(last_row - row), abs(last_column - column), 1)
        for step in range(steps + 1):
            self._set(
                row + round(step * (last_row - row) / steps),
                column + round(step * (last_column - column) / steps),
            )

    def _set(self, row: int, column: int) -> None:
        if 0 <= row < 4 * self.rows and 0 <= column < 2 * self.columns:
            cell = row // 4, column // 2
            self.cells[cell] = self.cells.get(cell, 0) | _DOTS[row % 4][column % 2]

    def lines(self) -> list[list[str]]:
        """Return the characters by row; without a dot they are blanks."""
        return [
            [
                chr(_BRAILLE + self.cells[row, column]) if (row, column) in self.cells else " "
                for column in range(self.columns)
            ]
            for row in range(self.rows)
        ]


def _strokes(door: PlanDoor) -> Iterator[tuple[Place, Place]]:
    """Yield what is drawn of a door besides its wall: jambs, and the leaf, or dashes where its state is not known."""
    out_x, out_y = (_JAMB_M * part for part in door.outward)
    for x, y in (door.left_m, door.right_m):
        yield (x - out_x, y - out_y), (x + out_x, y + out_y)
    if door.hinge_m is not None and door.tip_m is not None:
        yield door.hinge_m, door.tip_m
    elif door.state == "closed":
        yield door.left_m, door.right_m
    else:
        for first, last in ((0.1, 0.2), (0.45, 0.55), (0.8, 0.9)):
            yield _between(door, first), _between(door, last)


def _between(door: PlanDoor, share: float) -> Place:
    (x, y), (end_x, end_y) = door.left_m, door.right_m
    return x + share * (end_x - x), y + share * (end_y - y)


def _label(lines: list[list[str]], canvas: _Canvas, door: PlanDoor, number: int) -> Mark:
    """Write the name of a door beyond its wall, where there are blanks."""
    row, column = canvas.cell(door.middle_m)
    out_x, out_y = door.outward
    text = door.label if len(door.label) <= _LABEL else f"{door.label[: _LABEL - 1]}…"
    # Beyond the wall, then before it, then on it.
    for away in (2, 3, -2, -3, 1, 0):
        at_row = row - round(away * out_x / 1.6)
        middle = column - round(away * out_y * 1.3)
        start = middle - len(text) // 2
        if abs(out_y) > 0.5 and away:
            start = middle - len(text) + 1 if out_y * away > 0 else middle
        start = min(max(0, start), canvas.columns - len(text))
        if 0 <= at_row < canvas.rows and not "".join(lines[at_row][start : start + len(text)]).strip():
            _write(lines, at_row, start, text)
            return Mark(at_row, start, len(text), number)
    start = min(max(0, column), canvas.columns - len(text))
    _write(lines, row, start, text)
    return Mark(row, start, len(text), number)


def _write(lines: list[list[str]], row: int, column: int, text: str) -> None:
    lines[row][column : column + len(text)] = list(text)
