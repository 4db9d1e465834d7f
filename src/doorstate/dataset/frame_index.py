# SPDX-License-Identifier: Apache-2.0
"""`index.csv` of recorded frames: one line a file, with its label, and its camera where known.

Columns `file` and `state` are required. `fx`, `fy`, `cx`, `cy`, `width`, `height` (pixels), `depth_unit_m`, `frame` and
`roll_deg` override the read options of that file; an empty text or `?` is unknown. Further columns are kept.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from doorstate._files import read_csv
from doorstate.dataset.class_folders import label_of_folder
from doorstate.errors import DatasetError
from doorstate.io.camera import Intrinsics, Pinhole
from doorstate.io.options import ReadOptions

INDEX = "index.csv"
_CAMERA = ("fx", "fy", "cx", "cy")
_UNKNOWN = ("", "?")


def read_index(folder: Path, options: ReadOptions) -> list[tuple[dict[str, str], ReadOptions]]:
    """Return the lines of the index and the read options of each file.

    Raises:
        DatasetError: a line is invalid.
        CameraError: impossible intrinsics or units.
    """
    index = folder / INDEX
    rows = read_csv(index)
    if not rows:
        raise DatasetError("has no lines", path=index)
    for column in ("file", "state"):
        if column not in rows[0]:
            raise DatasetError(f"has no column {column!r}", path=index, field=column)
    entries: dict[str, tuple[dict[str, str], ReadOptions]] = {}
    for number, row in enumerate(rows, start=2):
        name, state = row["file"], row["state"].strip()
        if not name or not state:
            raise _invalid(index, number, "has no value", "state" if name else "file")
        if name in entries:
            raise _invalid(index, number, f"repeats {name!r}", "file")
        if not (folder / name).is_file():
            raise _invalid(index, number, f"no file {name!r} in the folder", "file")
        line = row | {"state": label_of_folder(state) or state}
        entries[name] = (line, _options(row, options, index, number))
    return list(entries.values())


def _invalid(index: Path, number: int, problem: str, column: str) -> DatasetError:
    return DatasetError(f"line {number} {problem}", path=index, field=column)


def _options(row: Mapping[str, str], options: ReadOptions, index: Path, number: int) -> ReadOptions:
    """Return the options with the values of a line."""

    def value(column: str) -> float | None:
        return _number(row, column, index, number)

    camera = {name: value(name) for name in _CAMERA}
    missing = [name for name, parameter in camera.items() if parameter is None]
    if missing and len(missing) < len(_CAMERA):
        raise _invalid(index, number, "needs fx, fy, cx and cy together", missing[0])
    if not missing:
        intrinsics = [parameter for parameter in camera.values() if parameter is not None]
        width, height = value("width"), value("height")
        if width is None or height is None:
            options = replace(options, intrinsics=Pinhole(*intrinsics))
        else:
            # With a size, images of another size are refused.
            options = replace(options, intrinsics=Intrinsics(round(width), round(height), *intrinsics))
    unit_m, roll_deg = value("depth_unit_m"), value("roll_deg")
    if unit_m is not None:
        options = replace(options, depth_scale_m=unit_m)
    if roll_deg is not None:
        options = replace(options, roll_deg=round(roll_deg))
    if row.get("frame", "") not in _UNKNOWN:
        options = replace(options, frame=row["frame"])  # type: ignore[arg-type]
    return options


def _number(row: Mapping[str, str], column: str, index: Path, number: int) -> float | None:
    text = row.get(column, "").strip()
    if text in _UNKNOWN:
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise _invalid(index, number, f"has {text!r}, which is not a number,", column)
    return value
