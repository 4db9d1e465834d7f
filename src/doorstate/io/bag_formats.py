# SPDX-License-Identifier: Apache-2.0
"""MCAP files of every profile: rosbags alone opens those of ROS 2 only, and reads definitions that nothing needs."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

ROS1, CDR = "ros1", "cdr"  # encodings of messages in MCAP files


def accept_any_profile() -> None:
    """Make rosbags open MCAP files of ROS 1, or of no profile, and ignore definitions and quality of service.

    Changes rosbags in the whole process. Messages are read by the definitions of doorstate, and quality of service is
    YAML, whose aliases can expand to gigabytes.
    """
    from rosbags.interfaces import MessageDefinition, MessageDefinitionFormat
    from rosbags.rosbag2 import reader, storage_mcap, storage_sqlite3

    storage_mcap.read_string = partial(_read_string, storage_mcap.read_bytes)
    storage_mcap.get_msgdef = lambda schema: MessageDefinition(MessageDefinitionFormat.NONE, "")
    modules: tuple[Any, ...] = (reader, storage_mcap, storage_sqlite3)
    for module in modules:
        module.parse_qos = lambda _: []


def encoding_of(connection: Any, is_ros1_bag: bool) -> str:
    """Return the encoding of the messages of a connection."""
    return ROS1 if is_ros1_bag else str(connection.ext.serialization_format)


def ros2_name(message_type: str) -> str:
    """Return the name of a message type as ROS 2 writes it: `sensor_msgs/Image` has no `msg` in ROS 1."""
    package, separator, name = message_type.partition("/")
    return f"{package}/msg/{name}" if separator and "/" not in name else message_type


def _read_string(read_bytes: Callable[[Any], bytes], stream: Any) -> str:
    """Return the next text of a record; of the first record, whose first text is the profile, always `ros2`."""
    is_first = stream.tell() == 0
    text = read_bytes(stream).decode()
    return "ros2" if is_first and text in (ROS1, "") else text
