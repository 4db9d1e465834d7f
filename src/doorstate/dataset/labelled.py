# SPDX-License-Identifier: Apache-2.0
"""Recorded clouds with their states, to be asked about and never trained on: folders, an `index.csv`, or a layout."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from doorstate._files import read_csv
from doorstate.dataset.class_folders import label_of_folder, nearest, row_of
from doorstate.dataset.layouts import find_layout
from doorstate.errors import ConfigError, DatasetError
from doorstate.io.camera import Intrinsics, Pinhole
from doorstate.io.find import find_clouds
from doorstate.io.options import DEFAULT_OPTIONS, ReadOptions
from doorstate.io.readers import read_cloud
from doorstate.types import Points

INDEX = "index.csv"
_CAMERA = ("fx", "fy", "cx", "cy")
_UNKNOWN = ("", "?")


@dataclass(frozen=True)
class LabelledFrame:
    """One cloud and what is known of it."""

    file: str  # below the folder
    label: str  # a state, `no_door`, or whatever else the index says
    columns: Mapping[str, str]  # all that is known, as written, without file and state
    folder: Path
    read: Callable[[], Points]


def labelled_frames(
    folder: Path, options: ReadOptions = DEFAULT_OPTIONS, layout: str | None = None
) -> list[LabelledFrame]:
    """Find the labelled clouds of a folder; none is read yet.

    An `index.csv` in it is taken before the names of sub-folders. Its columns `file` and `state` are needed; `fx`,
    `fy`, `cx`, `cy` (pixels), `depth_unit_m`, `frame` and `roll_deg` go before `options`; `?` or nothing is not known.

    Args:
        folder: with an index, or with sub-folders that are named after states.
        options: what neither files nor index say.
        layout: of `dataset.layouts`, in place of both.

    Raises:
        CloudReadError: no cloud at all.
        ConfigError: no such layout.
        DatasetError: nothing in it has a label, or a line of the index cannot be used.
        CameraError: the index holds intrinsics or units that are impossible.
    """
    if layout is not None:
        found = find_layout(layout)
        rows = found.rows(folder)
        return [_frame(folder, row, partial(found.read, folder / row["file"], options)) for row in rows]
    if not folder.is_dir():
        raise DatasetError(f"{folder}: is not a folder")
    if (folder / INDEX).is_file():
        return _indexed(folder, options)
    labels = {path: nearest(folder, path, label_of_folder) for path in find_clouds([folder])}
    rows = [row_of(folder, path, label) for path, label in labels.items() if label is not None]
    if not rows:
        raise DatasetError(
            f"{folder}: has no {INDEX}, and no clouds in folders named after states (closed, semi-open, open, no-door)"
        )
    return [_frame(folder, row, partial(read_cloud, folder / row["file"], options)) for row in rows]


def check_column(frames: Sequence[LabelledFrame], column: str) -> None:
    """Raise ConfigError unless something is known of at least one frame under this name."""
    known = list(dict.fromkeys(name for frame in frames for name in frame.columns))
    if column not in known:
        raise ConfigError(f"no column {column!r}; there are: {', '.join(known) or 'none'}")


def _frame(folder: Path, row: Mapping[str, str], read: Callable[[], Points]) -> LabelledFrame:
    columns = {name: value for name, value in row.items() if name not in ("sample_id", "file", "state")}
    return LabelledFrame(row["file"], row["state"], columns, folder, read)


def _indexed(folder: Path, options: ReadOptions) -> list[LabelledFrame]:
    index = folder / INDEX
    rows = read_csv(index)
    if not rows:
        raise DatasetError(f"{index}: has no lines")
    for column in ("file", "state"):
        if column not in rows[0]:
            raise DatasetError(f"{index}: has no column {column!r}, only {', '.join(rows[0])}")
    frames: dict[str, LabelledFrame] = {}
    for number, row in enumerate(rows, start=2):
        where = f"{index}: line {number}"
        name, state = row["file"], row["state"].strip()
        if not name or not state:
            raise DatasetError(f"{where} has no value in column {'state' if name else 'file'!r}")
        if name in frames:
            raise DatasetError(f"{where} names {name!r} a second time")
        if not (folder / name).is_file():
            raise DatasetError(f"{where} names {name!r}, which is not in the folder")
        read = partial(read_cloud, folder / name, _options(row, options, where))
        frames[name] = _frame(folder, row | {"state": label_of_folder(state) or state}, read)
    return list(frames.values())


def _options(row: Mapping[str, str], options: ReadOptions, where: str) -> ReadOptions:
    """What a line says of its file, before what is said of all."""
    camera = {name: _number(row, name, where) for name in _CAMERA}
    known = [value for value in camera.values() if value is not None]
    if known and len(known) < len(_CAMERA):
        lacking = ", ".join(name for name, value in camera.items() if value is None)
        raise DatasetError(f"{where} lacks {lacking}: fx, fy, cx and cy belong together")
    if known:
        options = replace(options, intrinsics=_camera(row, known, where))
    unit_m, roll_deg = _number(row, "depth_unit_m", where), _number(row, "roll_deg", where)
    if unit_m is not None:
        options = replace(options, depth_scale_m=unit_m)
    if roll_deg is not None:
        options = replace(options, roll_deg=round(roll_deg))
    if row.get("frame", "") not in _UNKNOWN:
        options = replace(options, frame=row["frame"])  # type: ignore[arg-type]
    return options


def _camera(row: Mapping[str, str], known: list[float], where: str) -> Intrinsics | Pinhole:
    """With an image size, if the index knows it: then another image is refused."""
    width, height = _number(row, "width", where), _number(row, "height", where)
    if width is None or height is None:
        return Pinhole(*known)
    return Intrinsics(round(width), round(height), *known)


def _number(row: Mapping[str, str], column: str, where: str) -> float | None:
    text = row.get(column, "").strip()
    if text in _UNKNOWN:
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise DatasetError(f"{where}, column {column}: {text!r} is no number")
    return value
