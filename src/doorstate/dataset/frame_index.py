# SPDX-License-Identifier: Apache-2.0
"""`index.csv` of recorded frames: one line a file, with its label, and its camera where known.

Columns `file` and `state` are required. `fx`, `fy`, `cx`, `cy`, `width`, `height` (pixels), `depth_unit_m`, `axes`,
`roll_deg`, `pitch_deg` and `quaternion` override the read options of that file; an empty text or `?` is unknown.
Further columns are kept.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from doorstate._files import read_csv
from doorstate.dataset.class_folders import label_of_folder
from doorstate.errors import DatasetError
from doorstate.io.camera import Intrinsics, Pinhole
from doorstate.io.options import ReadOptions
from doorstate.io.rotations import parse_quaternion

INDEX = "index.csv"
_NUMBERS = {"depth_unit_m": "depth_scale_m", "roll_deg": "roll_deg", "pitch_deg": "pitch_deg"}
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
            options = replace(
                options, intrinsics=Intrinsics(round(width), round(height), *Pinhole(*intrinsics))
            )
    changes: dict[str, Any] = {}
    for column, field in _NUMBERS.items():
        if (number_of_column := value(column)) is not None:
            changes[field] = number_of_column
    if (axes := row.get("axes", "").strip()) not in _UNKNOWN:
        changes["axes"] = axes
    if row.get("frame", "").strip() in ("body", "optical"):
        raise _invalid(index, number, "names axes in another column than `axes`", "frame")
    if (quaternion := row.get("quaternion", "").strip()) not in _UNKNOWN:
        changes |= {"quaternion": parse_quaternion(quaternion), "roll_deg": 0.0, "pitch_deg": 0.0}
    return replace(options, **changes)


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
