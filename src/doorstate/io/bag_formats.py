# SPDX-License-Identifier: Apache-2.0
"""MCAP files of every profile: rosbags alone opens those of ROS 2 only, and reads definitions that nothing needs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from threading import Lock
from typing import Any

ROS1, CDR = "ros1", "cdr"  # encodings of messages in MCAP files
_PATCHING = Lock()


@contextmanager
def any_profile() -> Iterator[None]:
    """Make rosbags open MCAP files of ROS 1, or of no profile, without definitions and quality of service.

    Messages are read by the definitions of doorstate, and quality of service is YAML, whose aliases can expand to
    gigabytes. rosbags is as before when the block ends; other threads wait until then.
    """
    from rosbags.interfaces import MessageDefinition, MessageDefinitionFormat
    from rosbags.rosbag2 import reader, storage_mcap, storage_sqlite3

    changes: list[tuple[Any, str, Callable[..., Any]]] = [
        (storage_mcap, "read_string", partial(_read_string, storage_mcap.read_bytes)),
        (storage_mcap, "get_msgdef", lambda _: MessageDefinition(MessageDefinitionFormat.NONE, "")),
        *((module, "parse_qos", lambda _: []) for module in (reader, storage_mcap, storage_sqlite3)),
    ]
    with _PATCHING:
        originals = [(module, name, getattr(module, name)) for module, name, _ in changes]
        try:
            for module, name, changed in changes:
                setattr(module, name, changed)
            yield
        finally:
            for module, name, original in originals:
                setattr(module, name, original)


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
