# SPDX-License-Identifier: Apache-2.0
"""ROS messages that hold clouds or depth images, from a bag or a live topic, read as points; needs no ROS."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from doorstate.io.camera import Intrinsics
from doorstate.io.depth_messages import pixels_from_compressed_depth, pixels_from_image
from doorstate.io.pointcloud2 import points_from_pointcloud2
from doorstate.io.readers import ReadOptions, points_from_depth, points_in_body
from doorstate.types import Points

# Message types by the names that ROS 2 gives them; rosbags names those of ROS 1 alike.
CLOUD = "sensor_msgs/msg/PointCloud2"
IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"


def points_from_message(message: Any, message_type: str, options: ReadOptions) -> Points:
    """Read a message of one of the three types as points in the body frame.

    Args:
        message: has the fields of its type.
        message_type: CLOUD, IMAGE or COMPRESSED_IMAGE.
        options: as of cloud files and depth images; images need a camera.

    Returns:
        (H, W, 3) or (N, 3) metres, x forward, y left, z up, NaN where nothing was measured.

    Raises:
        CloudReadError: another image than depth, or a message that contradicts itself.
        CameraError: an image without a camera, or with one of another size.
    """
    return _READERS[message_type](message, options)


def intrinsics_from_message(info: Any) -> Intrinsics:
    """Camera of rectified images of a CameraInfo, as ROS' own depth_image_proc takes it: P, or K where P is not set.

    Raises:
        CameraError: the camera was not calibrated.
    """
    matrix, projection = (info.k, info.p) if hasattr(info, "k") else (info.K, info.P)  # ROS 2, ROS 1
    numbers, places = (projection, (0, 5, 2, 6)) if projection[0] else (matrix, (0, 4, 2, 5))
    return Intrinsics(info.width, info.height, *(float(numbers[place]) for place in places))


def stamp_ns_of(message: Any) -> int:
    """When a message with a header was taken, in nanoseconds; 0 where its driver does not say."""
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def is_optical(frame_id: str) -> bool:
    """Whether a frame is, by its name (REP 103), x right, y down, z forward."""
    return "optical" in frame_id


def _points_from_cloud(message: Any, options: ReadOptions) -> Points:
    points = points_from_pointcloud2(
        message.height,
        message.width,
        message.fields,
        message.is_bigendian,
        message.point_step,
        message.row_step,
        message.data,
    )
    return points_in_body(points, options)


def _points_from_image(message: Any, options: ReadOptions) -> Points:
    pixels = pixels_from_image(
        message.height, message.width, message.encoding, message.is_bigendian, message.step, message.data
    )
    return points_from_depth(pixels, options)


def _points_from_compressed(message: Any, options: ReadOptions) -> Points:
    return points_from_depth(pixels_from_compressed_depth(message.format, message.data), options)


_READERS: dict[str, Callable[[Any, ReadOptions], Points]] = {
    CLOUD: _points_from_cloud,
    IMAGE: _points_from_image,
    COMPRESSED_IMAGE: _points_from_compressed,
}
