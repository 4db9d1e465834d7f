# SPDX-License-Identifier: Apache-2.0
"""`index.csv` of frames: one line a file, or one a door of it, with its camera where known, and its label.

Column `file` is required, for labelled frames `state` too. `fx`, `fy`, `cx`, `cy`, `width`, `height` (pixels),
`depth_unit_m`, `axes`, `roll_deg`, `pitch_deg`, `quaternion` and `camera_height_m` override the read options of that
file; an empty text or `?` is unknown. `door_x_m`, `door_y_m`, `door_yaw_deg`, `door_width_m` and `door_floor_z_m` are
the place of the door of a line in the level sensor frame (`Doorway`); with a place in each, a file may have several
lines. `door` and `moment` name the door and the still view, by which frames depend on each other. Further columns are
kept. Files are inside the folder of the index.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from doorstate._files import read_csv
from doorstate._paths import resolve_inside
from doorstate.dataset.class_folders import label_of_folder
from doorstate.doorways.doorway import Doorway
from doorstate.errors import CameraError, DatasetError, DoorstateError
from doorstate.io.camera import Intrinsics, Pinhole
from doorstate.io.find import INDEX_FILE
from doorstate.io.options import ReadOptions
from doorstate.io.rotations import parse_quaternion

_NUMBERS = {
    "depth_unit_m": "depth_scale_m",
    "roll_deg": "roll_deg",
    "pitch_deg": "pitch_deg",
    "camera_height_m": "camera_height_m",
}
_CAMERA = ("fx", "fy", "cx", "cy")
PLACE_COLUMNS = {f"door_{name}": name for name in ("x_m", "y_m", "yaw_deg", "width_m", "floor_z_m")}
"""Fields of a `Doorway` by column."""
DOOR_COLUMN, MOMENT_COLUMN = "door", "moment"
_UNKNOWN = ("", "?")
_LEVELS = 3  # folders above a file that may hold its index, as in Depth/Test/Closed


class IndexLine(NamedTuple):
    """Line of a labelled frame."""

    row: dict[str, str]
    options: ReadOptions
    doorway: Doorway | None  # place of the door that is labelled


def read_index(folder: Path, options: ReadOptions) -> list[IndexLine]:
    """Return the lines of labelled frames; those without a state are left out.

    Raises:
        DatasetError: a line is invalid, or names a file that does not exist or is outside of the folder.
        CameraError: impossible intrinsics, units or rotations.
    """
    index = folder / INDEX_FILE
    rows = _read_rows(index, ("file", "state"))
    if not rows:
        raise DatasetError("has no lines", path=index)
    entries = []
    for number, row in enumerate(rows, start=2):
        state = row["state"].strip()
        if not state:
            continue
        if not (folder / row["file"]).is_file():
            raise _invalid(index, number, f"no file {row['file']!r} in the folder", "file")
        line = row | {"state": label_of_folder(state) or state}
        entries.append(
            IndexLine(line, _options(row, options, index, number), doorway_of_line(row, index, number))
        )
    if not entries:
        raise DatasetError("has no line with a state", path=index, field="state")
    return entries


class IndexedOptions:
    """Read options of files, changed by the index in the folder of a file or in one of the two folders above.

    Args:
        options: options of files that no index names.
    """

    def __init__(self, options: ReadOptions) -> None:
        self._options = options
        self._indexes: dict[Path, dict[Path, ReadOptions] | DoorstateError] = {}

    def of(self, path: Path) -> ReadOptions:
        """Return the options of a file.

        Raises:
            DatasetError: the index is damaged, or a line of it is invalid.
            CameraError: impossible intrinsics, units or rotations.
        """
        path = _normalized(path)
        for folder in path.parents[:_LEVELS]:
            if folder not in self._indexes:
                self._indexes[folder] = self._read(folder)
            index = self._indexes[folder]
            if isinstance(index, DoorstateError):
                raise index
            if path in index:
                return index[path]
        return self._options

    def _read(self, folder: Path) -> dict[Path, ReadOptions] | DoorstateError:
        index = folder / INDEX_FILE
        if not index.is_file():
            return {}
        try:
            return {
                _normalized(folder / row["file"]): _options(row, self._options, index, number)
                for number, row in enumerate(_read_rows(index, ("file",)), start=2)
            }
        except DoorstateError as error:
            return error


def doorway_of_line(row: Mapping[str, str], index: Path, number: int) -> Doorway | None:
    """Return the place of the door of a line, or None without one.

    Raises:
        DatasetError: a number of it is missing or impossible.
    """
    values = {field: _number(row, column, index, number) for column, field in PLACE_COLUMNS.items()}
    missing = [column for column, field in PLACE_COLUMNS.items() if values[field] is None]
    if len(missing) == len(values):
        return None
    if missing:
        raise _invalid(index, number, f"places a door without {missing[0]}", missing[0])
    doorway = Doorway(**{field: value or 0.0 for field, value in values.items()})
    if doorway.width_m <= 0:
        raise _invalid(index, number, f"has a door of {doorway.width_m:g} m", "door_width_m")
    return doorway


def _normalized(path: Path) -> Path:
    return Path(os.path.normpath(path.absolute()))


def _read_rows(index: Path, columns: tuple[str, ...]) -> list[dict[str, str]]:
    """Return the lines of an index with these columns, each with a file of its own inside the folder.

    Lines that place a door may share a file.
    """
    rows = read_csv(index)
    places: dict[str, bool] = {}  # of the lines of a file
    for number, row in enumerate(rows, start=2):
        for column in columns:
            if column not in row:
                raise DatasetError(f"has no column {column!r}", path=index, field=column)
        name = row["file"]
        if not name:
            raise _invalid(index, number, "has no value", "file")
        has_place = bool(row.get("door_x_m", "").strip())
        if name in places and not (has_place and places[name]):
            raise _invalid(index, number, f"repeats {name!r}", "file")
        places[name] = has_place
        for column in ("file", "rgb"):
            try:
                resolve_inside(index.parent, row.get(column, ""))
            except DatasetError as error:
                raise _invalid(index, number, error.message, column) from error
    return rows


def _invalid(index: Path, number: int, problem: str, column: str) -> DatasetError:
    return DatasetError(f"line {number}: {problem}", path=index, field=column)


def _options(row: Mapping[str, str], options: ReadOptions, index: Path, number: int) -> ReadOptions:
    """Return the options with the values of a line."""
    values = {
        column: _number(row, column, index, number) for column in (*_CAMERA, "width", "height", *_NUMBERS)
    }
    if row.get("frame", "").strip() in ("body", "optical"):
        raise _invalid(index, number, "names axes in another column than `axes`", "frame")
    try:
        changes: dict[str, Any] = {
            field: values[column] for column, field in _NUMBERS.items() if values[column] is not None
        }
        if (camera := _camera(values, index, number)) is not None:
            changes["intrinsics"] = camera
        if (axes := row.get("axes", "").strip()) not in _UNKNOWN:
            changes["axes"] = axes
        if (quaternion := row.get("quaternion", "").strip()) not in _UNKNOWN:
            changes |= {"roll_deg": None, "pitch_deg": None, "quaternion": parse_quaternion(quaternion)}
        elif "roll_deg" in changes or "pitch_deg" in changes:
            changes["quaternion"] = None
        return replace(options, **changes)
    except CameraError as error:
        raise CameraError(
            f"line {number}: {error.message}", path=index, field=error.field, expected=error.expected
        ) from error


def _camera(values: Mapping[str, float | None], index: Path, number: int) -> Intrinsics | Pinhole | None:
    """Return the camera of a line; with a size, images of another size are refused."""
    missing = [name for name in _CAMERA if values[name] is None]
    if len(missing) == len(_CAMERA):
        return None
    if missing:
        raise _invalid(index, number, "needs fx, fy, cx and cy together", missing[0])
    pinhole = Pinhole(*(values[name] or 0.0 for name in _CAMERA))
    width, height = values["width"], values["height"]
    if width is None or height is None:
        return pinhole
    if not (width.is_integer() and height.is_integer()):
        raise _invalid(index, number, f"has {width:g} x {height:g} pixels", "width")
    return Intrinsics(int(width), int(height), *pinhole)


def _number(row: Mapping[str, str], column: str, index: Path, number: int) -> float | None:
    text = row.get(column, "").strip()
    if text in _UNKNOWN:
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise _invalid(index, number, f"{text[:40]!r} is not a number", column)
    return value
