# SPDX-License-Identifier: Apache-2.0
"""Rows of numbers in text, read line by line by numpy; numbers in the spellings of other tools are read too.

Quick where numpy understands every number. Otherwise the rows are read again by `_number`: C++ streams write NaN as
`-nan(ind)`, `nan(0x7fc00000)` or `1.#QNAN`, pandas writes nothing, and half of Europe writes 1,5 for 1.5.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Iterator, Sequence
from itertools import chain, islice

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import CloudReadError
from doorstate.io.size_limits import check_point_count, check_size

Lines = Callable[[], Iterator[tuple[int, str]]]
"""Starts a new iteration over numbered lines, from 1, without comments and blank lines."""

_MAX_LINE = 1 << 16  # characters
_COMMENT = re.compile(r"(?<![0-9]\.)#.*|\A\s*//.*")  # 1.#INF is a number
_NAN = re.compile(
    r"[+-]?(?:[qs]?nan[qs]?(?:\([\w.+-]*\))?|\d\.\#(?:[qs]nan|ind)\d*)|n/?a|<na>|null|none", re.IGNORECASE
)
_INFINITY = re.compile(r"([+-]?)\d\.\#inf\d*", re.IGNORECASE)
_MAX_SHOWN = 40  # characters of a cell


def text_lines(data: bytes) -> Iterator[tuple[int, str]]:
    """Iterate over the lines of a text in UTF-8 or UTF-16, whatever ends them, numbered from 1.

    Raises:
        CloudReadError: a null byte, or a line as long as no row of numbers is.
    """
    is_utf16 = data[:2] in (b"\xff\xfe", b"\xfe\xff")
    if not is_utf16 and b"\0" in data:
        raise CloudReadError("is not text: it holds null bytes")
    encoding = "utf-16" if is_utf16 else "utf-8-sig"
    stream = io.TextIOWrapper(io.BytesIO(data), encoding, errors="replace")
    for number, line in enumerate(iter(lambda: stream.readline(_MAX_LINE), ""), start=1):
        if len(line) == _MAX_LINE:
            raise CloudReadError(f"line {number} has more than {_MAX_LINE} characters: no rows of numbers")
        yield number, line.strip()


def without_comment(line: str) -> str:
    """Return a line up to its comment, which `#` starts, or `//` at its beginning."""
    return _COMMENT.sub("", line).strip() if "#" in line or "/" in line else line


def split_cells(line: str, delimiter: str | None) -> list[str]:
    """Return the cells of a row as numpy splits it; None stands for any number of blanks."""
    if '"' in line:
        try:
            quoted = csv.reader([line], delimiter=delimiter or " ", skipinitialspace=True)
            return [cell.strip() for cell in next(quoted) if cell or delimiter]
        except csv.Error:
            line = line.replace('"', "")
    return [cell.strip() for cell in line.split(delimiter)]


def is_number(cell: str) -> bool:
    """Return True if a cell is a number, NaN in any spelling, or empty."""
    try:
        _number(cell)
    except ValueError:
        return False
    return True


def parse_rows(
    body: bytes,
    columns: Sequence[int],
    count: int,
    skip: int = 0,
    first_line: int = 1,
    change: Callable[[str], str] | None = None,
) -> NDArray[np.float64]:
    """Read three columns of the blank-separated rows that follow the header of an ASCII PCD or PLY file.

    Args:
        body: text after the header.
        columns: places of x, y, z in a row.
        count: rows the header declares.
        skip: rows to leave out before them.
        first_line: number of the first line of the body in its file.
        change: changes a row before its columns are read.

    Returns:
        (count, 3) in file order and units.

    Raises:
        CloudReadError: there are fewer rows, or one is not numbers.
    """
    check_point_count(count)

    def rows() -> Iterator[tuple[int, str]]:
        chosen = islice(_rows_of(text_lines(body)), skip, skip + count)
        return ((first_line - 1 + number, change(row) if change else row) for number, row in chosen)

    points = load_columns(rows, columns, None)
    check_size(count, len(points), "points")
    return points


def load_columns(rows: Lines, columns: Sequence[int], delimiter: str | None) -> NDArray[np.float64]:
    """Read columns of rows of numbers.

    Args:
        rows: starts an iteration over the rows.
        columns: places in a row.
        delimiter: character between cells, or None for blanks.

    Returns:
        (rows, columns) float64.

    Raises:
        CloudReadError: a row is too short, or a cell of these columns is not a number.
    """
    numbered = rows()
    first = next(numbered, None)
    if first is None:
        return np.empty((0, len(columns)))
    try:
        return _load(chain([first], numbered), columns, delimiter, None)
    except ValueError:
        pass
    try:
        return _load(rows(), columns, delimiter, _number)
    except ValueError as error:
        raise _explain(rows(), columns, delimiter) from error


def table_rows(data: bytes, first_line: int) -> Lines:
    """Return the rows of a text from a line on, as `load_columns` takes them."""
    return lambda: _rows_of((number, line) for number, line in text_lines(data) if number >= first_line)


def _rows_of(lines: Iterator[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    for number, line in lines:
        if row := without_comment(line):
            yield number, row


def _load(
    rows: Iterator[tuple[int, str]],
    columns: Sequence[int],
    delimiter: str | None,
    number: Callable[[str], float] | None,
) -> NDArray[np.float64]:
    return np.loadtxt(
        (row for _, row in rows),
        dtype=np.float64,
        comments=None,
        delimiter=delimiter,
        converters=number,
        usecols=tuple(columns),
        ndmin=2,
        quotechar='"',
    )


def _number(cell: str) -> float:
    text = cell.strip()
    if "_" in text or not text.isascii():  # Python's own spellings
        raise ValueError(text)
    try:
        return float(text)
    except ValueError:
        if not text or _NAN.fullmatch(text):
            return np.nan
        if infinite := _INFINITY.fullmatch(text):
            return float(f"{infinite[1]}inf")
        if text.count(",") == 1:
            return float(text.replace(",", "."))
        raise


def _explain(
    rows: Iterator[tuple[int, str]], columns: Sequence[int], delimiter: str | None
) -> CloudReadError:
    """Return the error of the first row that cannot be read."""
    for line, row in rows:
        cells = split_cells(row, delimiter)
        if len(cells) <= max(columns):
            count = "1 column" if len(cells) == 1 else f"{len(cells)} columns"
            return CloudReadError(f"line {line} has {count}", expected=f"at least {max(columns) + 1}")
        for column in columns:
            if not is_number(cells[column]):
                return CloudReadError(
                    f"line {line}, column {column + 1}: {cells[column][:_MAX_SHOWN]!r} is not a number",
                    expected="rows of numbers, or a header that names x, y and z",
                )
    return CloudReadError("holds no rows of numbers", expected="three numbers a row")
