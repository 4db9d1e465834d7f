# SPDX-License-Identifier: Apache-2.0
"""Calibration of a camera as ROS describes it, and the one rule by which files, bags and topics choose from it.

An image is rectified if its topic says `rect`, as image_proc names its topics, and not if it says `raw` only. Rectified
images have the projection matrix P, others the camera matrix K and the distortion. Where nothing tells, P is taken
if it is set, as in depth_image_proc. Binning and region of interest are applied to both as in image_geometry:
the offset first, then the division.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from doorstate.errors import CameraError
from doorstate.io.camera import Intrinsics, Pinhole
from doorstate.io.distortion import parse_distortion

_TRANSPORTS = ("/compressedDepth", "/compressed")  # suffixes of topic names by image_transport


@dataclass(frozen=True)
class Calibration:
    """Calibration of a camera at its full resolution.

    Args:
        width, height: full resolution in pixels.
        matrix: K, nine numbers row by row, or None.
        projection: P, twelve numbers row by row, or None.
        model: distortion model; may be empty.
        coefficients: distortion of the image that is not rectified.
        binning: columns and rows of the full resolution in one pixel; 0 is 1.
        region: x offset, y offset, width and height of the image at full resolution; zeros are all of it.
    """

    width: float
    height: float
    matrix: Sequence[float] | None = None
    projection: Sequence[float] | None = None
    model: str = ""
    coefficients: Sequence[float] = ()
    binning: tuple[int, int] = (1, 1)
    region: tuple[int, int, int, int] = (0, 0, 0, 0)

    def camera(self, rectified: bool | None = None) -> Intrinsics:
        """Return the camera of an image.

        Args:
            rectified: True for a rectified image, False for another; None if that is not known.

        Raises:
            CameraError: not calibrated, or a distortion that cannot be undone.
        """
        projection, matrix = _set(self.projection, 12), _set(self.matrix, 9)
        if projection is not None and (rectified is not False or matrix is None):
            return self._at_resolution(_pinhole(projection, 4))
        if matrix is None:
            raise CameraError("holds a camera that was not calibrated: K and P are zero or missing")
        distortion = None if rectified else parse_distortion(self.model, self.coefficients)
        return self._at_resolution(_pinhole(matrix, 3), distortion=distortion)

    def _at_resolution(self, full: Pinhole, **distortion: Any) -> Intrinsics:
        x, y, width, height = self.region
        columns, rows = (max(1, number) for number in self.binning)
        size = [(width or self.width) / columns, (height or self.height) / rows]
        if not all(map(float.is_integer, map(float, size))):
            raise CameraError(f"image size {size[0]:g} x {size[1]:g} is not in whole pixels")
        return Intrinsics(
            int(size[0]),
            int(size[1]),
            full.fx / columns,
            full.fy / rows,
            (full.cx - x) / columns,
            (full.cy - y) / rows,
            **distortion,
        )


def image_topic(topic: str) -> str:
    """Return the name of a topic without the suffix of its image transport."""
    return next((topic.removesuffix(suffix) for suffix in _TRANSPORTS if topic.endswith(suffix)), topic)


def is_rectified(topic: str) -> bool | None:
    """Return True if images of a topic are rectified, by the names of image_proc; None if the name does not tell."""
    name = image_topic(topic).rpartition("/")[2]
    if "rect" in name:
        return True
    return False if "raw" in name else None


def calibration_from_message(info: Any) -> Calibration:
    """Return the calibration of a CameraInfo of ROS 1 or ROS 2."""
    matrix, projection, coefficients = (
        (info.k, info.p, info.d) if hasattr(info, "k") else (info.K, info.P, info.D)  # ROS 2, ROS 1
    )
    region = getattr(info, "roi", None)
    offsets = ("x_offset", "y_offset", "width", "height")
    return Calibration(
        width=int(info.width),
        height=int(info.height),
        matrix=[float(number) for number in matrix],
        projection=[float(number) for number in projection],
        model=str(getattr(info, "distortion_model", "")),
        coefficients=[float(number) for number in coefficients],
        binning=(int(getattr(info, "binning_x", 0)), int(getattr(info, "binning_y", 0))),
        region=tuple(int(getattr(region, name, 0)) for name in offsets),  # type: ignore[arg-type]
    )


def calibration_from_mapping(entries: Mapping[str, Any]) -> Calibration:
    """Return the calibration of a camera_info file, a recorded topic, or a file of OpenCV, Open3D or RealSense.

    Raises:
        CameraError: an entry is missing, or is not numbers.
    """
    values = {str(name).lower(): value for name, value in entries.items()}
    width, height = (
        _first(values, *names) for names in (("width", "image_width"), ("height", "image_height"))
    )
    if width is None or height is None:
        raise CameraError("lacks width, height", expected=ENTRIES)
    region = values.get("roi")
    region = region if isinstance(region, dict) else {}
    offsets = ("x_offset", "y_offset", "width", "height")
    return Calibration(
        width=_number(width, "width"),
        height=_number(height, "height"),
        matrix=_matrix(values),
        projection=_numbers(_first(values, "p", "projection_matrix")),
        model=str(
            _first(values, "distortion_model", "model") or ("fisheye" if values.get("fisheye_model") else "")
        ),
        coefficients=_numbers(_first(values, "d", "distortion_coefficients", "dist_coeffs", "coeffs")) or (),
        binning=(_whole(values.get("binning_x")), _whole(values.get("binning_y"))),
        region=tuple(_whole(region.get(name)) for name in offsets),  # type: ignore[arg-type]
    )


ENTRIES = "entries width, height, fx, fy, cx, cy (or K)"


def _matrix(values: Mapping[str, Any]) -> list[float] | None:
    columnwise = _numbers(values.get("intrinsic_matrix"))  # Open3D stores it column by column
    if columnwise is not None:
        if len(columnwise) != 9:
            raise CameraError("the intrinsic matrix must be nine numbers")
        return [columnwise[3 * column + row] for row in range(3) for column in range(3)]
    matrix = _numbers(_first(values, "k", "camera_matrix", "cameramatrix"))
    if matrix is not None:
        return matrix
    names = {"fx": ("fx",), "fy": ("fy",), "cx": ("cx", "ppx"), "cy": ("cy", "ppy")}
    found = {name: _first(values, *synonyms) for name, synonyms in names.items()}
    if missing := [name for name, number in found.items() if number is None]:
        if len(missing) < len(found) or _first(values, "p", "projection_matrix") is None:
            raise CameraError(f"lacks {', '.join(missing)}", expected=ENTRIES)
        return None
    fx, fy, cx, cy = (_number(number, name) for name, number in found.items())
    return [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]


def _first(values: Mapping[str, Any], *names: str) -> Any:
    return next((values[name] for name in names if values.get(name) is not None), None)


def _numbers(value: Any) -> list[float] | None:
    """Return the numbers of a list, a list of rows, or a matrix of OpenCV; None for None."""
    if isinstance(value, dict):
        value = value.get("data")
    if value is None:
        return None
    rows = value if isinstance(value, list) else [value]
    return [_number(number, "matrix") for row in rows for number in (row if isinstance(row, list) else [row])]


def _number(value: Any, name: str) -> float:
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise CameraError(f"{str(value)[:40]!r} is not a number", field=name) from error


def _whole(value: Any) -> int:
    number = 0.0 if value is None else _number(value, "binning or roi")
    if not number.is_integer() or number < 0:
        raise CameraError(f"{number:g} pixels is impossible", field="binning or roi")
    return int(number)


def _set(matrix: Sequence[float] | None, count: int) -> Sequence[float] | None:
    """Return a matrix, or None if it is missing or zero, as drivers publish it without a calibration."""
    if matrix is None:
        return None
    if len(matrix) != count:
        raise CameraError(f"the camera matrix has {len(matrix)} numbers", expected=f"{count}, row by row")
    return matrix if matrix[0] else None


def _pinhole(matrix: Sequence[float], columns: int) -> Pinhole:
    return Pinhole(matrix[0], matrix[columns + 1], matrix[2], matrix[columns + 2])
