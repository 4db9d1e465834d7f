# SPDX-License-Identifier: Apache-2.0
"""Tables of points as text: .xyz, .txt and .csv files."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import CloudReadError
from doorstate.io.size_limits import check_size
from doorstate.io.text_rows import (
    is_number,
    load_columns,
    split_cells,
    table_rows,
    text_lines,
    without_comment,
)

_UNIT = re.compile(r"\s*(?:\[[^\]]*\]|\([^)]*\))")
# `X`, `x_m`; ParaView writes `Points:0`, `Points:1`, `Points:2`.
_AXIS_NAMES = (
    re.compile(r"[xyz]"),
    re.compile(r"[xyz][ _](?:m|dm|cm|mm|km)"),
    re.compile(r"points[:_][012]"),
)
_AXIS_OF = dict(zip("xyz012", "xyzxyz", strict=True))
_DELIMITERS = (";", ",", None)


class _Head(NamedTuple):
    """Lines before the first row of a table."""

    header: str  # "" if there is none
    is_comment: bool
    declared: int | None  # number of points in a line of its own
    first_line: int
    first_row: str


def parse_table(data: bytes) -> NDArray[np.float64]:
    """Read a text table with columns separated by commas, semicolons or blanks.

    The points are columns x, y, z of the header, in any order, or without a header the first three columns. Names in
    the header may have units (`X [m]`, `y_m`). The header may be a comment (`# x,y,z` by numpy.savetxt, `//X Y Z` by
    CloudCompare). A line with the number of points may come first. Numbers may have decimal commas if these do not
    separate columns. An empty cell is NaN, as pandas writes it.

    Returns:
        (N, 3) in file order and units.

    Raises:
        CloudReadError: the text is neither numbers nor a header with x, y, z, or a row breaks off.
    """
    head = _read_head(data)
    if head is None:
        return np.empty((0, 3))
    delimiter = _delimiter(head.first_row)
    columns = _columns(head, split_cells(head.first_row, delimiter), delimiter)
    points = load_columns(table_rows(data, head.first_line), columns, delimiter)
    if head.declared is not None:
        check_size(head.declared, len(points), "points")
        if head.declared < len(points):
            raise CloudReadError(f"declares {head.declared} points, and holds {len(points)}")
    return points


def _read_head(data: bytes) -> _Head | None:
    """Return what comes before the first row, or None if there are no rows."""
    header, is_comment, count = "", False, None
    for number, line in text_lines(data):
        row = without_comment(line)
        if not row:
            named = line.lstrip("#/ ")
            if _names_axes(named):
                header, is_comment = named, True
        elif count is None and not header and row.isascii() and row.isdecimal() and len(row) < 10:
            count = int(row)
        elif any(is_number(cell) for cell in split_cells(row, _delimiter(row)) if cell) or not row.strip(
            ",; "
        ):
            return _Head(header, is_comment, count, number, row)
        elif header and not is_comment:
            raise CloudReadError(
                f"line {number} is not numbers: {row[:40]!r}", expected="one header, then rows of numbers"
            )
        elif not _names_axes(row):
            raise _no_axes(split_cells(row, _delimiter(row)))
        else:
            header, is_comment = row, False
    if count is not None:
        check_size(count, 0, "points")
    return None


def _delimiter(row: str) -> str | None:
    """Return the character that separates the cells of a row; None stands for blanks."""
    if ";" in row:
        return ";"
    if "," not in row:
        return None
    # In `1,5 2,0 3,1` the commas are decimal: between two of them stand two numbers.
    cells = split_cells(row, ",")
    between = [cell.split() for cell in cells]
    return None if any(len(words) > 1 and all(map(is_number, words)) for words in between) else ","


def _columns(head: _Head, cells: Sequence[str], delimiter: str | None) -> Sequence[int]:
    """Return the columns of x, y and z."""
    widths = {len(cells), len(cells) - (delimiter is not None and not cells[-1])}
    if not head.header:
        return range(3)
    # Headers are split as the rows are; numpy.savetxt writes what it is given, whatever separates the rows.
    splits = [_names(head.header, mark) for mark in dict.fromkeys((delimiter, *_DELIMITERS))]
    for names in splits:
        if len(names) in widths and (axes := _axes(names)):
            return axes
    axes = _axes(splits[0])
    if head.is_comment:
        # A comment that mentions x, y and z among other words is no header.
        return axes if axes and sorted(axes) == [0, 1, 2] else range(3)
    if not axes:
        raise _no_axes(splits[0])
    raise CloudReadError(
        f"has a header of {len(splits[0])} columns, and rows of {len(cells)}",
        expected="a name for every column",
    )


def _names(header: str, delimiter: str | None) -> list[str]:
    names = split_cells(_UNIT.sub("", header), delimiter)
    return names[:-1] if delimiter and not names[-1] and len(names) > 3 else names


def _names_axes(header: str) -> bool:
    return any(_axes(_names(header, delimiter)) for delimiter in _DELIMITERS)


def _axes(names: Sequence[str]) -> list[int]:
    """Return the places of x, y and z among names, or [] if one of them is missing."""
    plain = [_UNIT.sub("", name).strip("'\" ").lower() for name in names]
    for pattern in _AXIS_NAMES:
        axes = [name if pattern.fullmatch(name) else "" for name in plain]
        found = {_AXIS_OF[name[-1] if name.startswith("p") else name[0]]: name for name in axes if name}
        if len(found) == 3:
            return [axes.index(found[axis]) for axis in "xyz"]
    return []


def _no_axes(names: Sequence[str]) -> CloudReadError:
    listed = ", ".join(name[:40] for name in names)
    return CloudReadError(
        f"has the columns {listed}", expected="columns named x, y and z, or rows of numbers"
    )
