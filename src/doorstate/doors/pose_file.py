# SPDX-License-Identifier: Apache-2.0
"""Poses of a camera from a file: a table with a header, or a trajectory in the format of the TUM RGB-D benchmark.

Columns of a table: `time` in seconds, `file` of a cloud, or both; then `x`, `y` and `yaw` in metres and degrees, or
`x`, `y`, `z`, `qx`, `qy`, `qz`, `qw`, the pose of the camera's frame in the map; optionally `position_error_m`,
`yaw_error_deg` and `frame`. A trajectory has lines `time x y z qx qy qz qw`.
Source: https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats
"""

from __future__ import annotations

import csv
import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from doorstate._input import read_input_text
from doorstate.doors.camera_place import POSITION_ERROR_M, YAW_ERROR_DEG, CameraPlace, MissingPlace
from doorstate.doors.named_door import DEFAULT_FRAME
from doorstate.doors.plane_pose import PlanePose, turned_deg
from doorstate.errors import CameraError, DoorFileError
from doorstate.io.rotations import (
    Quaternion,
    axes_matrix,
    heading_and_tilt_deg,
    parse_axes,
    quaternion_matrix,
)

MAX_POSES_BYTES = 1 << 28
MAX_GAP_S = 1.0  # between two poses that are interpolated; chosen: localisations publish at 1 to 50 Hz
_TUM = ("time", "x", "y", "z", "qx", "qy", "qz", "qw")
_PLANE, _FULL = ("x", "y", "yaw"), _TUM[1:]
_NUMBERS = {*_TUM, "yaw", "position_error_m", "yaw_error_deg"}
_MAX_COORDINATE_M = 1e4


class PoseDefaults(NamedTuple):
    """Values for poses that do not have their own."""

    position_error_m: float = POSITION_ERROR_M
    yaw_error_deg: float = YAW_ERROR_DEG
    frame: str = DEFAULT_FRAME
    axes: str = "ros"  # of the camera's frame, for quaternions (`io.rotations`)


DEFAULTS = PoseDefaults()


@dataclass(frozen=True)
class PoseFile:
    """Poses of a camera.

    Args:
        stamps_s: times in ascending order.
        places: one for each time.
        by_file: time, or None, and pose by the name of a cloud's file.
    """

    stamps_s: tuple[float, ...] = ()
    places: tuple[CameraPlace, ...] = ()
    by_file: Mapping[str, tuple[float | None, CameraPlace]] = field(default_factory=dict)

    def at(self, stamp_s: float) -> CameraPlace | MissingPlace:
        """Return the pose at a moment, between two of the file; one that is `MAX_GAP_S` away is not used."""
        if not self.stamps_s:
            return MissingPlace("the poses have no times")
        after = bisect_left(self.stamps_s, stamp_s)
        if after < len(self.stamps_s) and self.stamps_s[after] == stamp_s:
            return self.places[after]
        if after == 0 or after == len(self.stamps_s):
            return MissingPlace("the poses do not cover this time")
        first_s, last_s = self.stamps_s[after - 1], self.stamps_s[after]
        if last_s - first_s > MAX_GAP_S:
            return MissingPlace(f"the poses have a gap of {last_s - first_s:.1f} s here")
        first, last = self.places[after - 1], self.places[after]
        if first.frame != last.frame:
            return MissingPlace(f"the poses change from {first.frame} to {last.frame} here")
        return _between(first, last, (stamp_s - first_s) / (last_s - first_s))

    def of_file(self, path: Path) -> tuple[float | None, CameraPlace | MissingPlace]:
        """Return time and pose of a cloud's file, by the longest end of its path that the poses name."""
        for start in range(len(path.parts)):
            known = self.by_file.get("/".join(path.parts[start:]))
            if known is not None:
                return known
        return None, MissingPlace("the poses do not name this file")


def read_poses(path: Path, defaults: PoseDefaults = DEFAULTS) -> PoseFile:
    """Read poses of a camera.

    Args:
        path: table or trajectory.
        defaults: errors, frame and axes of poses without their own.

    Raises:
        DoorFileError: no such format, with the line and the column of the first problem.
    """
    text = read_input_text(path, MAX_POSES_BYTES, DoorFileError)
    reader = PoseReader(path, defaults)
    stamped: list[tuple[float, CameraPlace]] = []
    by_file: dict[str, tuple[float | None, CameraPlace]] = {}
    for number, line in enumerate(text.splitlines(), 1):
        pose = reader.read(line, number)
        if pose is None:
            continue
        if pose.file:
            if pose.file in by_file:
                raise _error(path, number, f"{pose.file!r} has a pose already", "file")
            by_file[pose.file] = pose.stamp_s, pose.place
        if pose.stamp_s is not None:
            stamped.append((pose.stamp_s, pose.place))
    if not reader.has_lines:
        raise DoorFileError("has no poses", path=path)
    stamped.sort(key=lambda pair: pair[0])
    for (first_s, first), (second_s, second) in pairwise(stamped):
        if first_s == second_s and first != second:
            raise DoorFileError(f"two poses at {first_s} s", path=path, field="time")
    return PoseFile(tuple(stamp for stamp, _ in stamped), tuple(place for _, place in stamped), by_file)


def parse_place(text: str, defaults: PoseDefaults = DEFAULTS) -> CameraPlace:
    """Return the pose of a text `x y yaw`, in metres and degrees.

    Raises:
        DoorFileError: no such text.
    """
    try:
        x_m, y_m, yaw_deg = (float(part) for part in text.replace(",", " ").split())
        if not all(map(math.isfinite, (x_m, y_m, yaw_deg))):
            raise ValueError
    except ValueError as error:
        raise DoorFileError(
            f"{text!r} is no pose", field="pose", expected="three numbers: x y yaw"
        ) from error
    return _at((x_m, y_m), yaw_deg, defaults)


class PoseLine(NamedTuple):
    """Pose of one line; it has a time, the file of a cloud, or both."""

    place: CameraPlace
    stamp_s: float | None
    file: str = ""


class PoseReader:
    """Reads poses line by line; the first line tells the columns.

    Args:
        path: named in errors.
        defaults: errors, frame and axes of poses without their own.

    Raises:
        DoorFileError: there are no such axes.
    """

    def __init__(self, path: Path, defaults: PoseDefaults = DEFAULTS) -> None:
        try:
            self._defaults = defaults._replace(axes=parse_axes(defaults.axes))
        except CameraError as error:
            raise DoorFileError(error.message, field=error.field, expected=error.expected) from error
        self._path = path
        self._names: Sequence[str] = ()

    @property
    def has_lines(self) -> bool:
        """True after the first line that is neither empty nor a comment."""
        return bool(self._names)

    def read(self, line: str, number: int) -> PoseLine | None:
        """Return the pose of a line; None for a header, a comment and an empty line.

        Args:
            line: line.
            number: its number, named in errors.

        Raises:
            DoorFileError: the line has another format.
        """
        line, path = line.strip(), self._path
        if not line or line.startswith("#"):
            return None
        is_table = self._names is not _TUM
        if not self._names:
            is_table = not _starts_with_number(line)
            names = [name.strip() for name in next(csv.reader([line]))] if is_table else _TUM
            if is_table:
                _check_columns(names, number, path)
            self._names = names
            if is_table:
                return None
        cells = next(csv.reader([line])) if is_table else line.replace(",", " ").split()
        row = _cells(self._names, cells, number, path)
        numbers = {
            name: _number(value, name, number, path)
            for name, value in row.items()
            if name in _NUMBERS and value
        }
        place = _place(row, numbers, self._defaults, number, path)
        pose = PoseLine(place, numbers.get("time"), row.get("file", ""))
        if pose.stamp_s is None and not pose.file:
            raise _error(path, number, "has neither a time nor a file", "time")
        return pose


def _starts_with_number(line: str) -> bool:
    try:
        float(line.replace(",", " ").split()[0])
    except (ValueError, IndexError):
        return False
    return True


def _check_columns(names: Sequence[str], line: int, path: Path) -> None:
    has_place = {*_PLANE} <= {*names} or {*_FULL} <= {*names}
    if not has_place or not {"time", "file"} & {*names} or len({*names}) != len(names):
        raise DoorFileError(
            f"line {line}: no header of poses",
            path=path,
            expected="time or file, and x, y, yaw or x, y, z, qx, qy, qz, qw; or lines: time x y z qx qy qz qw",
        )


def _cells(names: Sequence[str], cells: Sequence[str], line: int, path: Path) -> dict[str, str]:
    if len(cells) != len(names):
        raise DoorFileError(f"line {line}: {len(cells)} values for {len(names)} columns", path=path)
    return {name: cell.strip() for name, cell in zip(names, cells, strict=True)}


def _number(text: str, name: str, line: int, path: Path) -> float:
    try:
        number = float(text)
    except ValueError as error:
        raise _error(path, line, f"{text[:40]!r} is no number", name) from error
    if not math.isfinite(number) or (name in ("x", "y") and abs(number) > _MAX_COORDINATE_M):
        raise _error(path, line, f"{text[:40]} is out of range", name)
    if name.endswith(("_error_m", "_error_deg")) and not number >= 0:
        raise _error(path, line, f"{text[:40]} is no error", name)
    return number


def _place(
    row: Mapping[str, str], numbers: Mapping[str, float], defaults: PoseDefaults, line: int, path: Path
) -> CameraPlace:
    names = _FULL if "qw" in row else _PLANE
    missing = next((name for name in names if name not in numbers), None)
    if missing is not None:
        raise _error(path, line, "has no value", missing)
    position_m = numbers["x"], numbers["y"]
    if "qw" in row:
        x, y, z, w = (numbers[name] for name in _FULL[3:])
        try:
            place = place_of(position_m, (x, y, z, w), defaults)
        except CameraError as error:
            raise _error(path, line, error.message, "qx", error.expected) from error
    else:
        place = _at(position_m, numbers["yaw"], defaults)
    return place._replace(
        frame=row.get("frame") or defaults.frame,
        position_error_m=numbers.get("position_error_m", defaults.position_error_m),
        yaw_error_deg=numbers.get("yaw_error_deg", defaults.yaw_error_deg),
    )


def place_of(
    position_m: tuple[float, float], quaternion: Quaternion, defaults: PoseDefaults = DEFAULTS
) -> CameraPlace:
    """Return the pose of a camera in plan view.

    Args:
        position_m: x and y of the camera in the map.
        quaternion: rotation (x, y, z, w) from the frame of the camera to the map.
        defaults: errors, frame of the map, and axes of the camera's frame.

    Raises:
        CameraError: no rotation, no such axes, or a camera that looks straight up or down.
    """
    axes = np.array(axes_matrix(parse_axes(defaults.axes)))
    yaw_deg, _, _ = heading_and_tilt_deg(np.array(quaternion_matrix(quaternion)) @ axes.T)
    return _at(position_m, yaw_deg, defaults)


def _at(position_m: tuple[float, float], yaw_deg: float, defaults: PoseDefaults) -> CameraPlace:
    pose = PlanePose(*position_m, turned_deg(yaw_deg))
    return CameraPlace(pose, defaults.frame, defaults.position_error_m, defaults.yaw_error_deg)


def _error(path: Path, line: int, message: str, name: str, expected: str | None = None) -> DoorFileError:
    return DoorFileError(f"line {line}: {message}", path=path, field=name, expected=expected)


def _between(first: CameraPlace, last: CameraPlace, share: float) -> CameraPlace:
    """Return the pose at a share of the way from one to another, with the larger errors of both."""
    (x_m, y_m, yaw_deg), (other_x_m, other_y_m, other_yaw_deg) = first.pose, last.pose
    pose = PlanePose(
        x_m + share * (other_x_m - x_m),
        y_m + share * (other_y_m - y_m),
        turned_deg(yaw_deg + share * turned_deg(other_yaw_deg - yaw_deg)),
    )
    return CameraPlace(
        pose,
        first.frame,
        max(first.position_error_m, last.position_error_m),
        max(first.yaw_error_deg, last.yaw_error_deg),
    )
