# SPDX-License-Identifier: Apache-2.0
"""Pinhole camera of a depth image: intrinsics, and the files that other tools store them in."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple, Self

from doorstate.errors import CameraError, summarize_exception
from doorstate.io.plain_yaml import plain_documents

_MAX_BYTES = 1 << 15  # of a camera file: YAML takes seconds per megabyte
_ENTRIES = "entries width, height, fx, fy, cx, cy (or K)"


@dataclass(frozen=True)
class Intrinsics:
    """Pinhole intrinsics in pixels of a rectified image; pixel (0, 0) has its centre at (0, 0).

    Raises:
        CameraError: a size or focal length is not positive, or a number is not finite.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        if min(self.width, self.height) < 1:
            raise CameraError(
                f"an image size of {self.width} x {self.height} is impossible", expected="at least 1 pixel"
            )
        for name in ("fx", "fy", "cx", "cy"):
            value = getattr(self, name)
            if not math.isfinite(value) or (name in ("fx", "fy") and value <= 0):
                raise CameraError(f"{value} pixels is impossible: was the camera calibrated?", field=name)

    @classmethod
    def from_hfov(cls, width: int, height: int, hfov_rad: float) -> Self:
        """Return the ideal camera of a horizontal field of view: square pixels, centre in the middle.

        Source: gazebo_ros_pkgs, camera plugins: f = W / (2 tan(hfov / 2)), centre ((W - 1) / 2, (H - 1) / 2).
        """
        if not 0 < hfov_rad < math.pi:
            raise CameraError(f"{hfov_rad} rad is impossible", field="hfov_rad", expected="between 0 and pi")
        focal = width / (2 * math.tan(hfov_rad / 2))
        return cls(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)

    def turned_clockwise(self) -> Intrinsics:
        """Return the intrinsics of the image rotated clockwise by 90 degrees: (u, v) goes to (height - 1 - v, u)."""
        return Intrinsics(self.height, self.width, self.fy, self.fx, self.height - 1 - self.cy, self.cx)

    def check_image_size(self, width: int, height: int) -> None:
        """Check that an image has the size of the camera.

        Raises:
            CameraError: it has another size.
        """
        if (width, height) != (self.width, self.height):
            raise CameraError(
                f"the image has {width} x {height} pixels, the intrinsics are for {self.width} x {self.height}",
                field="intrinsics",
                expected="those of this image size",
            )


class Pinhole(NamedTuple):
    """Intrinsics in pixels, for images of any size."""

    fx: float
    fy: float
    cx: float
    cy: float


def pinhole_from_numbers(
    fx: float | None, fy: float | None, cx: float | None, cy: float | None
) -> Pinhole | None:
    """Return the camera of four numbers in pixels, or None if all of them are None.

    Raises:
        CameraError: only some of them are given.
    """
    numbers = {"fx": fx, "fy": fy, "cx": cx, "cy": cy}
    missing = [name for name, number in numbers.items() if number is None]
    if len(missing) == len(numbers):
        return None
    if fx is None or fy is None or cx is None or cy is None:
        raise CameraError("is missing", field=missing[0], expected="all four of fx, fy, cx and cy, or none")
    return Pinhole(fx, fy, cx, cy)


def read_intrinsics(path: Path) -> Intrinsics:
    """Read pinhole intrinsics from a JSON file or a ROS 1 / ROS 2 camera_info YAML file.

    Accepted are `fx fy cx cy` (or RealSense's `ppx ppy` for the centre), a row-major 3 x 3 matrix `K` or
    `k`, and `camera_matrix: {data: [...]}`; the size is `width height` or `image_width image_height`.
    Distortion is not applied: depth images of the common drivers are rectified.

    Raises:
        CameraError: the file cannot be read, or a number is missing or impossible.
    """
    try:
        text = _beginning(path).decode("utf-8-sig")
        # A recorded topic (`rostopic echo`) is a stream of documents, and the first may be empty.
        documents = [json.loads(text)] if path.suffix.lower() == ".json" else plain_documents(text)
        return _from_mapping(next((document for document in documents if document is not None), None))
    except CameraError as error:
        raise error.located(path) from error
    except OSError as error:
        raise CameraError(f"cannot be read ({error.strerror or error})", path=path) from error
    except Exception as error:  # on damaged bytes parsers raise exceptions of any type
        raise CameraError(
            f"not a JSON or YAML file with intrinsics ({summarize_exception(error)})", path=path
        ) from error


def _beginning(path: Path) -> bytes:
    """Return the content of a file, or its YAML documents that end within `_MAX_BYTES`."""
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
        raise CameraError("holds no intrinsics", expected=_ENTRIES)
    values = dict(entries)
    for name, synonym in (("width", "image_width"), ("height", "image_height"), ("cx", "ppx"), ("cy", "ppy")):
        values.setdefault(name, values.get(synonym))
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
        raise CameraError(f"lacks {', '.join(missing)}", expected=_ENTRIES)
    numbers = {name: float(values[name]) for name in names}
    if not (numbers["width"].is_integer() and numbers["height"].is_integer()):
        raise CameraError(f"image size {numbers['width']:g} x {numbers['height']:g} is not in whole pixels")
    return Intrinsics(int(numbers.pop("width")), int(numbers.pop("height")), **numbers)
