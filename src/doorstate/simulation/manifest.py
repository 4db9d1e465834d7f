# SPDX-License-Identifier: Apache-2.0
"""Manifest rows as CSV: one flat line a sample, nested settings as `door.hinge`, floats that read back exactly."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from doorstate.errors import DatasetError
from doorstate.files import write_text
from doorstate.simulation.generate import SampleRow
from doorstate.simulation.scene_rows import SceneRow

Row = SampleRow | SceneRow


def flatten(row: Row) -> dict[str, str]:
    """Columns and their text, in the order of the model's fields; what a row does not have is empty."""
    columns: dict[str, str] = {}
    for name, value in row.model_dump().items():
        if isinstance(value, dict):
            columns |= {f"{name}.{key}": str(inner) for key, inner in value.items()}
        else:
            columns[name] = "" if value is None else str(value)
    return columns


def unflatten(columns: Mapping[str, str]) -> Row:
    """The row behind a line of a manifest; columns the model does not know are left out.

    Raises:
        DatasetError: a column is missing or holds what it cannot hold.
    """
    model: type[Row] = SceneRow if columns.get("scene") else SampleRow
    nested: dict[str, Any] = {}
    for name, value in columns.items():
        outer, _, inner = name.partition(".")
        if outer not in model.model_fields or (model is SceneRow and not value):
            continue
        if inner:
            nested.setdefault(outer, {})[inner] = value
        else:
            nested[outer] = value
    try:
        return model.model_validate(nested)
    except ValidationError as error:
        problem = error.errors()[0]
        column = ".".join(str(step) for step in problem["loc"])
        raise DatasetError(
            f"manifest line {columns.get('sample_id', '?')}, column {column}: {problem['msg']}"
        ) from error


def numbers(rows: Sequence[Mapping[str, str]], *names: str) -> NDArray[np.float64]:
    """(M,) numbers under the first of the names that a row has, NaN where it has none."""
    return np.array([float(next((row[name] for name in names if row.get(name)), math.nan)) for row in rows])


def write_csv(path: Path, rows: Sequence[Mapping[str, str]]) -> None:
    """Write rows under the union of their columns, in order of appearance."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO(newline="")
    # Before Python 3.13 the writer leaves a lone carriage return unquoted, which reads back as the end of a line.
    returns = any("\r" in value for row in rows for value in (*row, *row.values()))
    writer = csv.DictWriter(
        text,
        names,
        restval="",
        lineterminator="\n",
        quoting=csv.QUOTE_ALL if returns else csv.QUOTE_MINIMAL,
    )
    writer.writeheader()
    writer.writerows(rows)
    write_text(path, text.getvalue())


def read_csv(path: Path) -> list[dict[str, str]]:
    """Read a CSV with a header line.

    Raises:
        DatasetError: the file is missing, is not text, or a line has another number of columns than the header.
    """
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            reader = csv.DictReader(stream, strict=True)
            rows = list(reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise DatasetError(f"{path}: cannot be read as CSV ({error})") from error
    for number, row in enumerate(rows, start=2):
        if None in row or None in row.values():
            raise DatasetError(f"{path}: line {number} has another number of columns than the header")
    return rows
