# SPDX-License-Identifier: Apache-2.0
"""Rotations of cameras: names of axes, tilt and quaternions.

Axes are three letters for the directions of x, y and z, seen along the view of a level camera: forward or back, left
or right, up or down. `flu` is the body frame of ROS REP 103, `rdf` its optical frame, `rub` that of OpenGL. Sources:
ROS REP 103; the same letters name coordinate frames in rerun (`ViewCoordinates`).

Tilt follows REP 103 and SDF: R_level_camera = R_y(pitch) R_x(roll) with camera axes x forward, y left, z up. Positive
pitch looks down; positive roll turns the camera clockwise, seen from behind it.
"""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import CameraError

Matrix = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
Quaternion = tuple[float, float, float, float]
"""x, y, z, w, as in ROS messages and SciPy."""

AXES = {"ros": "flu", "optical": "rdf", "opengl": "rub"}
"""Letters of frames that have a name."""

_DIRECTIONS = {
    "f": (1.0, 0.0, 0.0), "b": (-1.0, 0.0, 0.0),
    "l": (0.0, 1.0, 0.0), "r": (0.0, -1.0, 0.0),
    "u": (0.0, 0.0, 1.0), "d": (0.0, 0.0, -1.0),
}  # fmt: skip
_EXPECTED_AXES = "ros (flu), optical (rdf), opengl (rub) or the directions of x, y and z among f b l r u d"
_UNIT_TOLERANCE = 0.02  # of the length of a quaternion; three printed digits give 0.002
_MAX_PITCH_DEG = 80.0  # beyond, the heading of a camera in a level frame says little


def parse_axes(name: str) -> str:
    """Return three letters for the directions of x, y and z from a name of `AXES` or the letters themselves.

    Raises:
        CameraError: no such name, two axes along one line, or a left-handed frame.
    """
    letters = AXES.get(name.lower(), name.lower())
    if len(letters) != 3 or not set(letters) <= set(_DIRECTIONS):
        raise CameraError(f"unknown axes {name!r}", field="axes", expected=_EXPECTED_AXES)
    handedness = np.linalg.det(np.array(axes_matrix(letters)))
    if not handedness:
        raise CameraError(f"{name!r} repeats a direction", field="axes", expected=_EXPECTED_AXES)
    if handedness < 0:
        raise CameraError(
            f"{name!r} is left-handed, which would mirror the door",
            field="axes",
            expected="right-handed axes",
        )
    return letters


def axes_matrix(letters: str) -> Matrix:
    """Return R_flu_axes, which turns points with these axes into x forward, y left, z up."""
    x, y, z = (_DIRECTIONS[letter] for letter in letters)
    return (x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2])


def tilt_matrix(roll_deg: float, pitch_deg: float) -> Matrix:
    """Return R_level_camera = R_y(pitch) R_x(roll); quarter turns are exact."""
    cos_roll, sin_roll = _cos_sin(roll_deg)
    cos_pitch, sin_pitch = _cos_sin(pitch_deg)
    return (
        (cos_pitch, sin_pitch * sin_roll, sin_pitch * cos_roll),
        (0.0, cos_roll, -sin_roll),
        (-sin_pitch, cos_pitch * sin_roll, cos_pitch * cos_roll),
    )


def heading_matrix(heading_deg: float) -> Matrix:
    """Return R_z(heading)."""
    cosine, sine = _cos_sin(heading_deg)
    return (cosine, -sine, 0.0), (sine, cosine, 0.0), (0.0, 0.0, 1.0)


def quaternion_matrix(quaternion: Quaternion) -> Matrix:
    """Return the rotation matrix of a quaternion x, y, z, w.

    Raises:
        CameraError: its length is not 1, or it is not finite.
    """
    length = math.hypot(*quaternion)
    if not abs(length - 1) <= _UNIT_TOLERANCE:  # also for NaN
        raise CameraError(
            f"a quaternion of length {length:.3g} is no rotation", field="quaternion", expected="length 1"
        )
    x, y, z, w = (number / length for number in quaternion)
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )


def heading_and_tilt_deg(level_from_camera: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return heading, pitch and roll of R_z(heading) R_y(pitch) R_x(roll), (3, 3), in degrees.

    Raises:
        CameraError: the camera looks straight up or down, so it has no heading.
    """
    pitch_deg = math.degrees(math.asin(min(1.0, max(-1.0, -float(level_from_camera[2, 0])))))
    if abs(pitch_deg) > _MAX_PITCH_DEG:
        raise CameraError(
            f"the camera looks {abs(pitch_deg):.0f} degrees {'down' if pitch_deg > 0 else 'up'}",
            expected=f"at most {_MAX_PITCH_DEG:g}; is z up in the frame that the rotation leads to?",
        )
    heading_deg = math.degrees(math.atan2(level_from_camera[1, 0], level_from_camera[0, 0]))
    roll_deg = math.degrees(math.atan2(level_from_camera[2, 1], level_from_camera[2, 2]))
    return heading_deg, pitch_deg, roll_deg


def parse_quaternion(text: str) -> Quaternion:
    """Return the four numbers of a text such as `0 0.26 0 0.97` or `[0.0, 0.26, 0.0, 0.97]`: x, y, z, w.

    Raises:
        CameraError: not four numbers.
    """
    try:
        x, y, z, w = (float(number) for number in re.split(r"[\s,]+", text.strip(" \t[]()")))
    except ValueError as error:
        raise CameraError(
            f"{text!r} is no quaternion", field="quaternion", expected="four numbers x y z w"
        ) from error
    return x, y, z, w


def rotate(points: NDArray[np.floating], matrix: NDArray[np.float64]) -> NDArray[Any]:
    """Return rotated points (..., 3); turns that only swap axes move the numbers without changing them."""
    if np.array_equal(matrix, np.eye(3)):
        return points
    if np.isin(matrix, (-1.0, 0.0, 1.0)).all():
        sources = np.abs(matrix).argmax(axis=1)
        return np.stack(
            [
                points[..., source] if matrix[axis, source] > 0 else -points[..., source]
                for axis, source in enumerate(sources)
            ],
            axis=-1,
        )
    with np.errstate(over="ignore", invalid="ignore"):  # infinity is "not measured", and may become NaN
        return points.astype(np.float64) @ matrix.T


def _cos_sin(angle_deg: float) -> tuple[float, float]:
    quarters, rest_deg = divmod(angle_deg, 90)
    if rest_deg == 0:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarters) % 4]
    return math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
