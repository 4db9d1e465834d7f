# SPDX-License-Identifier: Apache-2.0
"""ROS message sensor_msgs/PointCloud2, read as points without ROS."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from doorstate._organized import flatten_unless_image
from doorstate.errors import CloudReadError
from doorstate.io.size_limits import check_point_count, check_size
from doorstate.types import Points

# Constants of sensor_msgs/PointField.
_FLOATS = {7: "f4", 8: "f8"}


# Types of uint8[] in rospy, rclpy and rosbags.
MessageBytes: TypeAlias = "bytes | array[int] | NDArray[np.uint8]"


class PointField(Protocol):
    """Interface of sensor_msgs/PointField: one value of a point."""

    @property
    def name(self) -> str: ...
    @property
    def offset(self) -> int: ...
    @property
    def datatype(self) -> int: ...
    @property
    def count(self) -> int: ...


def points_from_pointcloud2(
    height: int,
    width: int,
    fields: Sequence[PointField],
    is_bigendian: bool,
    point_step: int,
    row_step: int,
    data: MessageBytes,
) -> Points:
    """Read x, y and z of every point; other fields and padding are skipped.

    Args:
        height, width: rows and columns; unorganized clouds have one row.
        fields: places of the values within a point.
        is_bigendian: byte order of the values.
        point_step: bytes from a point to the next.
        row_step: bytes from a row to the next.
        data: the points.

    Returns:
        (height, width, 3) float32 in the unit and frame of the message (metres by ROS REP 103), NaN kept; (width, 3)
        where there is one row or the points have been shuffled, (0, 3) where there is no point.

    Raises:
        CloudReadError: x, y or z is missing or no float, or the message contradicts itself.
    """
    if min(height, width, point_step, row_step) < 0:
        raise CloudReadError(
            f"is damaged: {height} x {width} points in steps of {point_step} and {row_step} bytes are declared"
        )
    check_point_count(height * width)
    if height * width == 0:
        return np.empty((0, 3), np.float32)
    places = [_place(axis, fields, point_step) for axis in "xyz"]
    content = np.frombuffer(data, np.uint8)
    # Some drivers publish a wrong row_step (ros-drivers/velodyne#279, realsense-ros#1668): points that fill the
    # data to the last byte have rows without padding.
    if len(content) == height * width * point_step:
        row_step = width * point_step
    if width * point_step > row_step:
        raise CloudReadError(
            f"is damaged: {width} points of {point_step} bytes do not fit into rows of {row_step}"
        )
    check_size(height * row_step, len(content), "bytes")
    points = np.empty((height, width, 3), np.float32)
    # Overflow from float64 gives infinity, which is "not measured".
    with np.errstate(over="ignore", invalid="ignore"):
        for axis, (offset, stored) in enumerate(places):
            dtype = np.dtype(stored).newbyteorder(">" if is_bigendian else "<")
            points[..., axis] = np.ndarray((height, width), dtype, content, offset, (row_step, point_step))
    return flatten_unless_image(points) if height > 1 else points[0]


def _place(axis: str, fields: Sequence[PointField], point_step: int) -> tuple[int, str]:
    field = next((field for field in fields if field.name == axis), None)
    if field is None:
        names = " ".join(field.name for field in fields) or "none"
        raise CloudReadError(f"has the fields {names}", expected="x, y and z")
    if field.datatype not in _FLOATS or field.count not in (
        0,
        1,
    ):  # 0 is what drivers write that leave it out
        raise CloudReadError(
            f"has {field.count} values of datatype {field.datatype} as {axis}",
            expected="one float32 (7) or float64 (8)",
        )
    stored = _FLOATS[field.datatype]
    if not 0 <= field.offset <= point_step - np.dtype(stored).itemsize:
        raise CloudReadError(
            f"is damaged: {axis} at byte {field.offset} is not within {point_step} bytes a point"
        )
    return field.offset, stored
