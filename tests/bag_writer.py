# SPDX-License-Identifier: Apache-2.0
"""Bags for tests, written with rosbags."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

START_NS = 1_700_000_000_000_000_000
_MCAP = b"\x89MCAP0\r\n"
KINDS = ("bag", "db3", "mcap")


@dataclass
class Message:
    """Message to be written; its time of recording is a millisecond after its stamp."""

    topic: str
    type: str
    fields: dict[str, Any]
    stamp_ns: int
    frame_id: str = "camera_link"


def cloud(topic: str, points: NDArray[np.floating], stamp_ns: int = START_NS, **changes: Any) -> Message:
    """PointCloud2 of points (N, 3) or (H, W, 3), with a field intensity."""
    height, width = points.shape[:2] if points.ndim == 3 else (1, len(points))
    filled = np.concatenate([points, np.ones((*points.shape[:-1], 1))], -1).astype("<f4")
    fields = {
        "height": height,
        "width": width,
        "fields": [(name, 4 * place, 7, 1) for place, name in enumerate(("x", "y", "z", "intensity"))],
        "is_bigendian": False,
        "point_step": 16,
        "row_step": 16 * width,
        "data": np.frombuffer(filled.tobytes(), np.uint8),
        "is_dense": False,
    }
    return Message(topic, "PointCloud2", fields | changes, stamp_ns)


def image(
    topic: str, pixels: NDArray[Any], encoding: str, stamp_ns: int = START_NS, **changes: Any
) -> Message:
    """Image of pixels (H, W), in their byte order."""
    fields = {
        "height": pixels.shape[0],
        "width": pixels.shape[1],
        "encoding": encoding,
        "is_bigendian": int(pixels.dtype.byteorder == ">"),
        "step": pixels.shape[1] * pixels.itemsize,
        "data": np.frombuffer(pixels.tobytes(), np.uint8),
    }
    return Message(topic, "Image", fields | changes, stamp_ns)


def compressed_image(topic: str, data: bytes, image_format: str, stamp_ns: int = START_NS) -> Message:
    """CompressedImage."""
    return Message(
        topic, "CompressedImage", {"format": image_format, "data": np.frombuffer(data, np.uint8)}, stamp_ns
    )


def camera_info(
    topic: str, width: int, height: int, k: Sequence[float], p: Sequence[float], stamp_ns: int = START_NS
) -> Message:
    """CameraInfo with nine numbers K and twelve numbers P."""
    fields = {
        "height": height,
        "width": width,
        "distortion_model": "plumb_bob",
        "d": np.zeros(5),
        "k": np.array(k, np.float64),
        "r": np.eye(3).ravel(),
        "p": np.array(p, np.float64),
        "binning_x": 0,
        "binning_y": 0,
        "roi": None,
    }
    return Message(topic, "CameraInfo", fields, stamp_ns)


def text(topic: str) -> Message:
    """String message."""
    return Message(topic, "String", {"data": "hello"}, START_NS)


def write_bag(folder: Path, kind: str, messages: Sequence[Message], compression: str = "") -> Path:
    """Write a ROS 1 (`bag`) or ROS 2 bag (`db3`, `mcap`), and return its file, or the folder of ROS 2."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2

    folder.mkdir(parents=True, exist_ok=True)
    is_ros1 = kind == "bag"
    store = _store(is_ros1)
    writer: Any
    if is_ros1:
        path = folder / "test.bag"
        writer = Writer1(path)
        if compression:
            writer.set_compression(Writer1.CompressionFormat[compression])
    else:
        path = folder / f"ros2-{kind}"
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        writer = Writer2(path, version=9, storage_plugin=plugin)
        if compression:
            writer.set_compression(CompressionMode[compression], CompressionFormat.ZSTD)
    with writer:
        connections: dict[str, Any] = {}
        for message in messages:
            if message.topic not in connections:
                full = _full_name(message.type)
                connections[message.topic] = writer.add_connection(message.topic, full, typestore=store)
            content = _serialized(message, is_ros1)
            writer.write(connections[message.topic], message.stamp_ns + 1_000_000, content)
    return path


def write_mcap(path: Path, messages: Sequence[Message], profile: str, encoding: str) -> Path:
    """Write an MCAP file without chunks and index; profile `ros1`, `ros2` or "", messages as `ros1` or `cdr`.

    Source: https://mcap.dev/spec
    """

    def text(content: str) -> bytes:
        return struct.pack("<I", len(content)) + content.encode()

    def record(code: int, content: bytes) -> bytes:
        return struct.pack("<BQ", code, len(content)) + content

    is_ros1 = encoding == "ros1"
    parts = [record(1, text(profile) + text("tests"))]
    for number, message in enumerate(messages, start=1):
        name = _full_name(message.type)
        name = name.replace("/msg", "") if is_ros1 else name
        schema = struct.pack("<H", number) + text(name) + text(f"{encoding}msg") + text("any")
        channel = struct.pack("<HH", number, number) + text(message.topic) + text(encoding) + text("")
        times = struct.pack("<HIQQ", number, 0, message.stamp_ns, message.stamp_ns)
        parts += [record(3, schema), record(4, channel), record(5, times + _serialized(message, is_ros1))]
    content = b"".join(parts) + record(15, bytes(4)) + record(2, bytes(20))
    path.write_bytes(_MCAP + content + _MCAP)
    return path


def _serialized(message: Message, is_ros1: bool) -> bytes:
    store, full = _store(is_ros1), _full_name(message.type)
    built = _build(store, message, full, is_ros1)
    return bytes((store.serialize_ros1 if is_ros1 else store.serialize_cdr)(built, full))


def _full_name(message_type: str) -> str:
    return f"{'std_msgs' if message_type == 'String' else 'sensor_msgs'}/msg/{message_type}"


@cache
def _store(is_ros1: bool) -> Any:
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)


def _build(store: Any, message: Message, full: str, is_ros1: bool) -> Any:
    types, fields = store.types, dict(message.fields)
    if full.startswith("std_msgs"):
        return types[full](**fields)
    stamp = types["builtin_interfaces/msg/Time"](
        sec=message.stamp_ns // 10**9, nanosec=message.stamp_ns % 10**9
    )
    numbered = {"seq": 0} if is_ros1 else {}
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id=message.frame_id, **numbered)
    if "fields" in fields:
        kind = types["sensor_msgs/msg/PointField"]
        fields["fields"] = [kind(name=n, offset=o, datatype=d, count=c) for n, o, d, c in fields["fields"]]
    if "roi" in fields:
        region = types["sensor_msgs/msg/RegionOfInterest"]
        fields["roi"] = region(x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
        if is_ros1:
            fields = {name.upper() if name in "dkrp" else name: value for name, value in fields.items()}
    return types[full](header=header, **fields)
