# SPDX-License-Identifier: Apache-2.0
"""Points as rows of text: .xyz, .txt and .csv files, and the bodies of ASCII PCD and PLY files."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import CloudReadError
from doorstate.io.size_limits import check_size

_SEPARATOR = re.compile(r"\s*[,;]\s*|\s+")
_EMPTY_CELL = re.compile(r"([,;\n])[ \t]*(?=[,;\n])")


def parse_table(data: bytes) -> NDArray[np.float64]:
    """Read a text table with columns separated by commas, semicolons or blanks.

    The points are columns x, y, z of the header, in any order, or without a header the first three columns.
    The header may be a comment (`# x,y,z` by numpy.savetxt, `//X Y Z` by CloudCompare) if it names every
    column. An empty cell is NaN, as pandas writes it.

    Returns:
        (N, 3) in file order and units.

    Raises:
        CloudReadError: the text is neither numbers nor a header with x, y, z, or a row breaks off.
    """
    lines = [line.strip() for line in data.decode("utf-8-sig").splitlines()]
    header: list[str] = []
    header_is_comment = False
    for number, line in enumerate(lines):
        is_comment = line.startswith(("#", "//"))
        cells = _SEPARATOR.split(line.lstrip("#/ ").replace('"', "").lower())
        if {"x", "y", "z"} <= set(cells):
            header, header_is_comment = cells, is_comment
        elif line and not is_comment:
            # A comment that mentions x, y and z among other words is no header.
            named = header and (len(header) == len(cells) or not header_is_comment)
            columns = [header.index(axis) for axis in "xyz"] if named else range(3)
            delimiter = next((mark for mark in ";," if mark in line.split("#")[0]), None)
            rows = lines[number:]
            if delimiter:
                text = "\n".join(["", *filter(None, rows), ""])
                rows = _EMPTY_CELL.sub(r"\1nan", text).splitlines()
            return _load(rows, columns, delimiter)
    return np.empty((0, 3))


def parse_rows(body: bytes, columns: Sequence[int], count: int, skip: int = 0) -> NDArray[np.float64]:
    """Read three columns of the blank-separated rows that follow the header of an ASCII PCD or PLY file.

    Args:
        body: text after the header.
        columns: places of x, y, z in a row.
        count: rows the header declares.
        skip: rows to leave out before them.

    Returns:
        (count, 3) in file order and units.

    Raises:
        CloudReadError: there are fewer rows, or one is not numbers.
    """
    rows = [row for row in body.decode("utf-8", errors="replace").splitlines() if row.strip()]
    points = _load(rows[skip : skip + count], columns, None)
    check_size(count, len(points), "points")
    return points


def _load(rows: Sequence[str], columns: Sequence[int], delimiter: str | None) -> NDArray[np.float64]:
    rows = [row for row in rows if not row.lstrip().startswith("#")]
    if not rows:
        return np.empty((0, 3))
    try:
        return np.loadtxt(rows, dtype=np.float64, delimiter=delimiter, usecols=tuple(columns), ndmin=2)
    except ValueError as error:
        raise CloudReadError(f"{error}", expected="rows of numbers, or a header naming x, y, z") from error
