# SPDX-License-Identifier: Apache-2.0
"""Manifest of a data set as a pandas frame: numbers are numbers, and an empty field is missing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from doorstate._files import read_csv
from doorstate.dataset.store import manifest_path
from doorstate.errors import DatasetError

_UNITS = ("_m", "_deg", "_px", "_share")
"""Endings of the names of columns that hold numbers."""


def read_manifest(folder: Path) -> pd.DataFrame:
    """Read the manifest of a data set folder as `manifest_frame` returns it.

    Raises:
        DatasetError: the file is missing or damaged.
    """
    path = manifest_path(folder)
    try:
        return manifest_frame(read_csv(path))
    except ValueError as error:
        raise DatasetError(str(error), path=path) from error


def manifest_frame(rows: Sequence[Mapping[str, str]]) -> pd.DataFrame:
    """Return manifest rows as a frame in the same order, indexed by `sample_id`.

    Columns whose names end in a unit (`_m`, `_deg`, `_px`, `_share`) are float64 with NaN for an empty field.

    Raises:
        DatasetError: a column that every manifest has is missing, or two samples have one name.
        ValueError: a field of such a column is not a number.
    """
    frame = pd.DataFrame(list(rows), dtype="str")
    for column in ("sample_id", "state"):
        if column not in frame:
            raise DatasetError("column is missing", field=column)
    repeated = frame["sample_id"][frame["sample_id"].duplicated()]
    if len(repeated):
        raise DatasetError(f"several samples are named {repeated.iloc[0]!r}", field="sample_id")
    frame = frame.where((frame != "") | (frame.columns == "sample_id"))
    for column in frame.columns:
        if column.endswith(_UNITS):
            frame[column] = frame[column].map(float, na_action="ignore").astype("float64")
    return frame.set_index("sample_id", drop=False)


def number_values(frame: pd.DataFrame, name: str) -> pd.Series[float]:
    """Return a column of numbers, NaN throughout where the manifest does not have it."""
    return frame[name] if name in frame else pd.Series(math.nan, index=frame.index, dtype="float64")


def text_values(frame: pd.DataFrame, name: str) -> pd.Series[str]:
    """Return a column of text, "" where a field is empty or the manifest does not have the column."""
    return frame[name].fillna("") if name in frame else pd.Series("", index=frame.index, dtype="str")
