# SPDX-License-Identifier: Apache-2.0
"""Manifest rows as columns: one flat line a sample, nested settings as `door.hinge`, floats that read back exactly."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from doorstate.errors import DatasetError, first_validation_error
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
        if outer not in model.model_fields or not value:
            continue
        if inner:
            nested.setdefault(outer, {})[inner] = value
        else:
            nested[outer] = value
    try:
        return model.model_validate(nested)
    except ValidationError as error:
        line = columns.get("sample_id", "?")
        raise DatasetError(f"manifest line {line}, column {first_validation_error(error)}") from error


def numbers(rows: Sequence[Mapping[str, str]], *names: str) -> NDArray[np.float64]:
    """(M,) numbers under the first of the names that a row has, NaN where it has none."""
    return np.array([float(next((row[name] for name in names if row.get(name)), math.nan)) for row in rows])
