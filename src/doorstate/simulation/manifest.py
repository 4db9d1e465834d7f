# SPDX-License-Identifier: Apache-2.0
"""Manifest rows as CSV columns: nested settings as `camera.width`, the scene as JSON, floats that read back exactly."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from doorstate.errors import DatasetError, first_validation_error
from doorstate.simulation.row import Row

MANIFEST_FILE = "manifest.csv"
_OPTIONAL = ("bias", "other_doors", "conditions")


def flatten(row: Row) -> dict[str, str]:
    """Return columns and their text in the order of the fields; None is an empty text.

    A row without a bias, other doors or conditions has no column of them, as in older manifests.
    """
    columns: dict[str, str] = {}
    for name, value in row.model_dump(exclude={name for name in _OPTIONAL if not getattr(row, name)}).items():
        if isinstance(value, dict):
            columns |= {f"{name}.{key}": _text(inner) for key, inner in value.items()}
        else:
            columns[name] = _text(value)
    return columns


def unflatten(columns: Mapping[str, str]) -> Row:
    """Return the row of a line; columns that are no fields of `Row` are ignored.

    Raises:
        DatasetError: a column is missing or has an invalid value.
    """
    nested: dict[str, Any] = {}
    for name, value in columns.items():
        outer, _, inner = name.partition(".")
        if outer not in Row.model_fields or not value:
            continue
        if not inner:
            nested[outer] = value
        elif isinstance(group := nested.setdefault(outer, {}), dict):
            group[inner] = value
        else:
            raise DatasetError(f"stands beside a column {outer!r}", field=name)
    try:
        return Row.model_validate(nested)
    except ValidationError as error:
        sample = columns.get("sample_id", "?")
        raise DatasetError(f"manifest line {sample}, column {first_validation_error(error)}") from error


def numbers(rows: Sequence[Mapping[str, str]], column: str) -> NDArray[np.float64]:
    """Return the (M,) numbers of a column, NaN where a row lacks it."""
    return np.array([float(row.get(column) or math.nan) for row in rows])


def _text(value: object) -> str:
    return "" if value is None else str(value)
