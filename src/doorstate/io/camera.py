# SPDX-License-Identifier: Apache-2.0
"""The pinhole camera of a depth image: its intrinsics, and the files other tools keep them in."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple, Self

from doorstate.errors import CameraError, summarize_exception
from doorstate.io.plain_yaml import plain_documents

_MAX_BYTES = 1 << 15  # of a camera file: reading YAML takes seconds a megabyte


@dataclass(frozen=True)
class Intrinsics:
    """Pinhole intrinsics in pixels of a rectified image; pixel (0, 0) has its centre at (0, 0).

    Raises:
        CameraError: when a size or focal length is not positive, or a number is not finite.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        if min(self.width, self.height) < 1:
            raise CameraError(f"image size {self.width} x {self.height}: both must be at least 1 pixel")
        for name in ("fx", "fy", "cx", "cy"):
            value = getattr(self, name)
            if not math.isfinite(value) or (name in ("fx", "fy") and value <= 0):
                raise CameraError(f"{name} = {value} pixels is impossible: was the camera calibrated?")

    @classmethod
    def from_hfov(cls, width: int, height: int, hfov_rad: float) -> Self:
        """Give the ideal camera of a horizontal field of view: square pixels, centre in the middle.

        Source: gazebo_ros_pkgs, camera plugins: f = W / (2 tan(hfov / 2)), centre ((W - 1) / 2, (H - 1) / 2).
        """
        if not 0 < hfov_rad < math.pi:
            raise CameraError(f"a field of view of {hfov_rad} rad is impossible: it lies between 0 and pi")
        focal = width / (2 * math.tan(hfov_rad / 2))
        return cls(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)

    def turned_clockwise(self) -> Intrinsics:
        """Those of the image turned clockwise by 90 degrees: pixel (u, v) goes to (height - 1 - v, u)."""
        return Intrinsics(self.height, self.width, self.fy, self.fx, self.height - 1 - self.cy, self.cx)

    def check_image_size(self, width: int, height: int) -> None:
        """Raise CameraError unless an image of this size belongs to the camera."""
        if (width, height) != (self.width, self.height):
            raise CameraError(
                f"the image has {width} x {height} pixels, the intrinsics are for "
                f"{self.width} x {self.height}: give those of this image size"
            )


class Pinhole(NamedTuple):
    """Intrinsics in pixels of images of whatever size."""

    fx: float
    fy: float
    cx: float
    cy: float


def read_intrinsics(path: Path) -> Intrinsics:
    """Read pinhole intrinsics from a JSON file or a ROS 1 / ROS 2 camera_info YAML file.

    Accepted are `fx fy cx cy` (or RealSense's `ppx ppy` for the centre), a row-major 3 x 3 matrix `K` or
    `k`, and `camera_matrix: {data: [...]}`; the size is `width height` or `image_width image_height`.
    Distortion is not applied: depth images of the common drivers are rectified.

    Raises:
        CameraError: when the file cannot be read, lacks a number, or holds impossible ones.
    """
    try:
        text = _beginning(path).decode("utf-8-sig")
        # A recorded topic (`rostopic echo`) is a stream of documents: take the first that holds anything.
        documents = [json.loads(text)] if path.suffix.lower() == ".json" else plain_documents(text)
        return _from_mapping(next((document for document in documents if document is not None), None))
    except CameraError as error:
        raise CameraError(f"{path.name}: {error}") from error
    except OSError as error:
        raise CameraError(f"{path.name}: cannot be read ({error.strerror or error})") from error
    except Exception as error:  # whatever a parser makes of foreign bytes
        raise CameraError(
            f"{path.name}: not a JSON or YAML file with intrinsics ({summarize_exception(error)})"
        ) from error


def _beginning(path: Path) -> bytes:
    """All of a file, or those of its documents that end within `_MAX_BYTES`."""
    with path.open("rb") as stream:
        content = stream.read(_MAX_BYTES + 1)
    if len(content) <= _MAX_BYTES:
        return content
    documents, separator, _ = content.rpartition(b"\n---")
    if not separator:
        raise CameraError(f"is larger than {_MAX_BYTES >> 10} KiB, so no camera")
    return documents


def _from_mapping(entries: Any) -> Intrinsics:
    if not isinstance(entries, dict):
        raise CameraError("holds no intrinsics: expected entries width, height, fx, fy, cx, cy (or K)")
    values = dict(entries)
    for ours, theirs in (("width", "image_width"), ("height", "image_height"), ("cx", "ppx"), ("cy", "ppy")):
        values.setdefault(ours, values.get(theirs))
    matrix = values.get("K", values.get("k", values.get("camera_matrix")))
    if isinstance(matrix, dict):
        matrix = matrix.get("data")
    if matrix is not None:
        if isinstance(matrix, list) and len(matrix) == 3:
            matrix = [number for row in matrix for number in row]
        if not isinstance(matrix, list) or len(matrix) != 9:
            raise CameraError("the camera matrix K must be nine numbers, row by row")
        values |= {"fx": matrix[0], "cx": matrix[2], "fy": matrix[4], "cy": matrix[5]}
    names = [field.name for field in fields(Intrinsics)]
    if missing := [name for name in names if values.get(name) is None]:
        raise CameraError(
            f"lacks {', '.join(missing)}: expected entries width, height, fx, fy, cx, cy (or K)"
        )
    numbers = {name: float(values[name]) for name in names}
    if not (numbers["width"].is_integer() and numbers["height"].is_integer()):
        raise CameraError(f"image size {numbers['width']:g} x {numbers['height']:g} is not in whole pixels")
    return Intrinsics(int(numbers.pop("width")), int(numbers.pop("height")), **numbers)
