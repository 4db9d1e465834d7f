# SPDX-License-Identifier: Apache-2.0
"""ROS 1 and ROS 2 bags (.bag, .db3, .mcap), read cloud by cloud without ROS.

Messages are read by the definitions that have been fixed since ROS 1. Definitions recorded in the bag are ignored, so
that other messages cannot prevent its clouds from being read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

from doorstate.errors import CameraError, CloudReadError, DoorstateError, needs_extra, summarize_exception
from doorstate.io.bag_formats import CDR, ROS1, any_profile, encoding_of, ros2_name
from doorstate.io.bag_limits import (
    check_files,
    keep_packed,
    limit_unpacking,
    limited_sqlite,
    unpack_zstd,
)
from doorstate.io.calibration import calibration_from_message, image_topic, is_rectified
from doorstate.io.camera import Intrinsics
from doorstate.io.depth_messages import check_compressed_format, check_encoding
from doorstate.io.formats import BAG_SUFFIXES
from doorstate.io.messages import (
    CAMERA_INFO,
    CLOUD,
    COMPRESSED_IMAGE,
    IMAGE,
    cloud_from_message,
    stamp_ns_of,
)
from doorstate.io.options import DEFAULT_OPTIONS, ReadOptions
from doorstate.io.sensor_pose import PosedCloud, SensorPose
from doorstate.types import Points

_ZSTD = b"\x28\xb5\x2f\xfd"  # RFC 8878, 3.1.1


class BagTopic(NamedTuple):
    """A topic of a bag."""

    name: str
    type: str  # such as sensor_msgs/msg/PointCloud2, also in ROS 1
    messages: int


class StampedCloud(NamedTuple):
    """Cloud of one message."""

    stamp_s: float  # of the header, or the time of recording if that is zero
    frame_id: str
    cloud: Points | DoorstateError  # (H, W, 3) or (N, 3) in the body frame, or the error of a damaged message
    pose: SensorPose | None = None  # of the camera; None for a damaged message


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """Open a ROS 1 bag (.bag) or a ROS 2 bag (its folder, or one .db3 or .mcap file).

    Raises:
        MissingExtraError: the package rosbags is not installed.
        CloudReadError: no bag, or damaged.
    """
    with needs_extra("a ROS bag"):
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.rosbag2 import Reader as Reader2
        from rosbags.typesys import Stores, get_typestore
    if not path.exists():
        raise CloudReadError("no such file or folder", path=path)
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        raise CloudReadError(
            "has no metadata.yaml, so it is not a ROS 2 bag", path=path, hint="open the file inside"
        )
    if path.is_file() and path.suffix not in BAG_SUFFIXES:
        raise CloudReadError(
            "is not a bag", path=path, expected=f"a file {' '.join(BAG_SUFFIXES)}, or a ROS 2 bag folder"
        )
    check_files(path)
    is_ros1 = path.is_file() and path.suffix == ".bag"
    deserializers = {
        ROS1: get_typestore(Stores.ROS1_NOETIC).deserialize_ros1,
        CDR: get_typestore(Stores.LATEST).deserialize_cdr,
    }
    limit_unpacking()
    with ExitStack() as stack:
        with _wrap_errors(path, "damaged, or no bag"), limited_sqlite():
            reader = Reader1(path) if is_ros1 else Reader2(path)
            with any_profile():
                reader.open()
            stack.callback(reader.close)
            if not is_ros1:
                keep_packed(reader)
            bag = Bag(path, reader, deserializers, is_ros1)
        yield bag


class Bag:
    """Open bag, returned by `open_bag`."""

    def __init__(
        self, path: Path, reader: Any, deserializers: Mapping[str, Callable[[bytes, str], Any]], is_ros1: bool
    ) -> None:
        self._path = path
        self._reader = reader
        self._deserializers = deserializers
        self._encodings: dict[str, str] = {}  # by topic
        topics: dict[str, BagTopic] = {}
        for connection in reader.connections:
            name, message_type = connection.topic, connection.msgtype
            # SQLite and YAML may hold other types.
            if isinstance(name, str) and isinstance(message_type, str):
                message_type = ros2_name(message_type)
                self._encodings[name] = encoding_of(connection, is_ros1)
                topic = topics.get(name, BagTopic(name, message_type, 0))
                topics[name] = topic._replace(messages=topic.messages + int(connection.msgcount))
        self._topics = topics

    @property
    def topics(self) -> list[BagTopic]:
        """All topics, sorted by name."""
        return [self._topics[name] for name in sorted(self._topics)]

    def choose(self, name: str | None = None) -> BagTopic:
        """Return the topic of this name, or the only one that can be read.

        Raises:
            CloudReadError: there is no such topic, or more than one; the error lists the readable ones.
        """
        problem = "" if name is None else self._problem(name)
        if name is not None and not problem:
            return self._topics[name]
        readable = [topic for topic in self.topics if not self._problem(topic.name)]
        if name is None and len(readable) == 1:
            return readable[0]
        if name is None and readable:
            problem = f"{len(readable)} topics can be read, and none was chosen"
        elif name is None:
            problem = f"none of the {len(self.topics)} topics holds clouds or depth images"
        listed = ", ".join(f"{topic.name} ({_short(topic.type)}, {topic.messages})" for topic in readable)
        raise CloudReadError(problem, path=self._path, field="topic", expected=listed or None)

    def clouds(
        self,
        topic: BagTopic,
        options: ReadOptions = DEFAULT_OPTIONS,
        camera_info_topic: str | None = None,
        every: int = 1,
        start: int = 0,
    ) -> Iterator[StampedCloud]:
        """Read the clouds of a topic in the order of recording.

        Args:
            topic: a topic returned by `choose`.
            options: axes, tilt, units and camera.
            camera_info_topic: topic with the camera of depth images; None takes the camera of the options, or the
                topic `camera_info` beside the images.
            every: read one of this number of messages.
            start: number of the first message to read.

        Raises:
            CameraError: depth images without a camera.
            CloudReadError: the bag is damaged from here on. A single damaged message is yielded with its error.
        """
        convert = self._converter(topic, options, camera_info_topic)
        for log_ns, raw in islice(self._raw_messages(topic.name), start, None, every):
            yield self._stamped(log_ns, raw, topic, convert)

    def _problem(self, name: str) -> str:
        """Return the reason why a topic cannot be read, or ""; images are checked by the encoding of the first."""
        topic = self._topics.get(name)
        if topic is None:
            return f"no topic {name}"
        if topic.messages == 0:
            return f"{name} holds no messages"
        if topic.type not in (CLOUD, IMAGE, COMPRESSED_IMAGE):
            return f"{name} holds {_short(topic.type)} messages"
        if self._encodings[name] not in self._deserializers:
            return f"{name} holds messages encoded as {self._encodings[name]!r}, not by ROS"
        if topic.type != CLOUD:
            try:
                message = self._first(topic)
                if topic.type == IMAGE:
                    check_encoding(message.encoding)
                else:
                    check_compressed_format(message.format)
            except CloudReadError as error:
                return f"{name} {error.describe(with_path=False)}"
        return ""

    def _raw_messages(self, name: str) -> Iterator[tuple[int, bytes]]:
        connections = [connection for connection in self._reader.connections if connection.topic == name]
        with _wrap_errors(self._path, "damaged from here on"):
            for _, log_ns, raw in self._reader.messages(connections):
                yield int(log_ns), raw

    def _first(self, topic: BagTopic) -> Any:
        _, raw = next(self._raw_messages(topic.name), (0, b""))
        with _wrap_errors(self._path, f"damaged message of {topic.name}"):
            return self._message(raw, topic)

    def _message(self, raw: bytes, topic: BagTopic) -> Any:
        deserialize = self._deserializers[self._encodings[topic.name]]
        return deserialize(unpack_zstd(raw) if raw[:4] == _ZSTD else raw, topic.type)

    def _stamped(
        self, log_ns: int, raw: bytes, topic: BagTopic, convert: Callable[[Any], PosedCloud]
    ) -> StampedCloud:
        stamp_ns, frame_id = log_ns, ""
        cloud: Points | DoorstateError
        pose: SensorPose | None = None
        try:
            message = self._message(raw, topic)
            stamp_ns = stamp_ns_of(message) or log_ns
            frame_id = message.header.frame_id
            cloud, pose = convert(message)
        except DoorstateError as error:
            cloud = error
        except Exception as error:  # on damaged bytes rosbags and Pillow raise exceptions of any type
            cloud = CloudReadError(f"damaged message ({summarize_exception(error)})")
        return StampedCloud(stamp_ns / 1e9, frame_id, cloud, pose)

    def _converter(
        self, topic: BagTopic, options: ReadOptions, camera_info_topic: str | None
    ) -> Callable[[Any], PosedCloud]:
        if topic.type != CLOUD and (camera_info_topic is not None or options.intrinsics is None):
            rectified = is_rectified(topic.name) if options.rectified is None else options.rectified
            camera = self._camera(camera_info_topic or _camera_info_beside(topic.name), rectified)
            options = replace(options, intrinsics=camera)
        return lambda message: cloud_from_message(message, topic.type, options)

    def _camera(self, name: str, rectified: bool | None) -> Intrinsics:
        """Return the camera of the first good message; drivers send zeros before they know their camera."""
        topic = self._topics.get(name)
        if topic is None or topic.type != CAMERA_INFO or topic.messages == 0:
            raise CameraError(
                f"depth images need a camera, and there is no CameraInfo in {name}",
                path=self._path,
                field="camera_info_topic",
                suggestions={"camera_info_topic": None, "intrinsics": None},
            )
        problem: CameraError | None = None
        for _, raw in self._raw_messages(name):
            with _wrap_errors(self._path, f"damaged message of {name}"):
                info = self._message(raw, topic)
            try:
                return calibration_from_message(info).camera(rectified)
            except CameraError as error:
                problem = problem or error
        reason = "holds no messages" if problem is None else str(problem)
        raise CameraError(f"{name}: {reason}", path=self._path) from problem


def _camera_info_beside(topic: str) -> str:
    return image_topic(topic).rpartition("/")[0] + "/camera_info"


def _short(message_type: str) -> str:
    return message_type.rpartition("/")[2]


@contextmanager
def _wrap_errors(path: Path, problem: str) -> Iterator[None]:
    """Turn exceptions of any type, as rosbags raises on damaged bytes, into CloudReadError."""
    try:
        yield
    except DoorstateError:
        raise
    except Exception as error:
        raise CloudReadError(f"{problem} ({summarize_exception(error)})", path=path) from error
