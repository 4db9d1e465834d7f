# SPDX-License-Identifier: Apache-2.0
"""Clouds and depth images of ROS messages, from a bag or a live topic, read as points without ROS."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from doorstate.io.body_frame import points_from_depth, points_in_body
from doorstate.io.depth_messages import pixels_from_compressed_depth, pixels_from_image
from doorstate.io.options import ReadOptions
from doorstate.io.pointcloud2 import points_from_pointcloud2
from doorstate.io.sensor_pose import PosedCloud

# Message types by their ROS 2 names; rosbags uses the same names for ROS 1.
CLOUD = "sensor_msgs/msg/PointCloud2"
IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"


def cloud_from_message(message: Any, message_type: str, options: ReadOptions) -> PosedCloud:
    """Read a message of one of the three types as points in the body frame.

    Args:
        message: has the fields of its type.
        message_type: CLOUD, IMAGE or COMPRESSED_IMAGE.
        options: axes, tilt, units and camera; images need a camera.

    Returns:
        (H, W, 3) or (N, 3) metres, x forward, y left, z up, NaN where nothing was measured, and the pose.

    Raises:
        CloudReadError: an image without depth, or fields that contradict each other.
        CameraError: an image without a camera, or with one of another size.
    """
    return _READERS[message_type](message, options)


def stamp_ns_of(message: Any) -> int:
    """Return the header stamp of a message in nanoseconds; 0 if its driver does not set one."""
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _points_from_cloud(message: Any, options: ReadOptions) -> PosedCloud:
    points = points_from_pointcloud2(
        message.height,
        message.width,
        message.fields,
        message.is_bigendian,
        message.point_step,
        message.row_step,
        message.data,
    )
    return points_in_body(points, options, frame_id=str(message.header.frame_id))


def _points_from_image(message: Any, options: ReadOptions) -> PosedCloud:
    pixels = pixels_from_image(
        message.height, message.width, message.encoding, message.is_bigendian, message.step, message.data
    )
    return points_from_depth(pixels, options)


def _points_from_compressed(message: Any, options: ReadOptions) -> PosedCloud:
    return points_from_depth(pixels_from_compressed_depth(message.format, message.data), options)


_READERS: dict[str, Callable[[Any, ReadOptions], PosedCloud]] = {
    CLOUD: _points_from_cloud,
    IMAGE: _points_from_image,
    COMPRESSED_IMAGE: _points_from_compressed,
}
