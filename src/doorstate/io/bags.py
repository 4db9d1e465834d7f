# SPDX-License-Identifier: Apache-2.0
"""Recordings of ROS 1 and ROS 2 (.bag, .db3, .mcap), read cloud by cloud without ROS.

Messages are read as what they have been since ROS 1: definitions recorded in a bag are not asked, so that nothing else
in it can keep its clouds from being read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

from doorstate.errors import CameraError, CloudReadError, DoorstateError, missing_extra, summarize_exception
from doorstate.io.bag_limits import (
    check_metadata,
    keep_packed,
    limit_unpacking,
    limited_sqlite,
    unpack_zstd,
)
from doorstate.io.camera import Intrinsics
from doorstate.io.depth_messages import check_compressed_format, check_encoding
from doorstate.io.messages import (
    CAMERA_INFO,
    CLOUD,
    COMPRESSED_IMAGE,
    IMAGE,
    intrinsics_from_message,
    points_from_message,
    stamp_ns_of,
)
from doorstate.io.readers import DEFAULT_OPTIONS, ReadOptions
from doorstate.types import Points

_COMPRESSED_DEPTH = "/compressedDepth"  # how image_transport ends the names of such topics
_ZSTD = b"\x28\xb5\x2f\xfd"  # RFC 8878, 3.1.1


class BagTopic(NamedTuple):
    """A topic of a bag."""

    name: str
    type: str  # such as sensor_msgs/msg/PointCloud2, in ROS 1 too
    messages: int


class StampedCloud(NamedTuple):
    """What one message holds."""

    stamp_s: float  # of its header; where that is zero, when it was recorded
    frame_id: str
    cloud: Points | DoorstateError  # (H, W, 3) or (N, 3) in the body frame, or why there is none


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """Open a recording of ROS 1 (.bag) or ROS 2 (its folder, or one .db3 or .mcap file).

    Raises:
        MissingExtraError: the package rosbags is not installed.
        CloudReadError: no bag, or a damaged one.
    """
    try:
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.rosbag2 import Reader as Reader2
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise missing_extra("a ROS bag", "rosbags") from error
    if not path.exists():
        raise CloudReadError(f"{path}: no such file or folder")
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        raise CloudReadError(f"{path.name}: has no metadata.yaml, so is no ROS 2 bag: give the file inside")
    if path.is_file() and path.suffix not in (".bag", ".db3", ".mcap"):
        raise CloudReadError(f"{path.name}: no bag: give a .bag, .db3 or .mcap file, or a ROS 2 bag folder")
    is_ros1 = path.is_file() and path.suffix == ".bag"
    types = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.LATEST)
    limit_unpacking()
    with ExitStack() as stack:
        with _one_line(path, "damaged, or no bag"), limited_sqlite():
            if path.is_dir():
                check_metadata(path)
            reader = Reader1(path) if is_ros1 else Reader2(path)
            reader.open()
            stack.callback(reader.close)
            if not is_ros1:
                keep_packed(reader)
            bag = Bag(path, reader, types.deserialize_ros1 if is_ros1 else types.deserialize_cdr)
        yield bag


class Bag:
    """An open recording; `open_bag` makes it."""

    def __init__(self, path: Path, reader: Any, deserialize: Callable[[bytes, str], Any]) -> None:
        self._path = path
        self._reader = reader
        self._deserialize = deserialize
        found: dict[str, BagTopic] = {}
        for connection in reader.connections:
            name, message_type = connection.topic, connection.msgtype
            if isinstance(name, str) and isinstance(message_type, str):  # SQLite and YAML hold what they like
                known = found.get(name, BagTopic(name, message_type, 0))
                found[name] = known._replace(messages=known.messages + int(connection.msgcount))
        self._topics = [found[name] for name in sorted(found)]

    @property
    def topics(self) -> list[BagTopic]:
        """Every topic, sorted by name."""
        return self._topics

    def choose(self, name: str | None = None) -> BagTopic:
        """The topic of this name, or the only one that can be read.

        Raises:
            CloudReadError: there is none such, or more than one; the error lists those that can be read.
        """
        if name is not None:
            complaint = self._complaint(name)
            if not complaint:
                return next(topic for topic in self.topics if topic.name == name)
        usable = [topic for topic in self.topics if not self._complaint(topic.name)]
        listed = ", ".join(f"{topic.name} ({_short(topic.type)}, {topic.messages})" for topic in usable)
        if name is not None:
            raise CloudReadError(
                f"{self._path.name}: topic {name} {complaint}; usable are: {listed or 'none'}"
            )
        if not usable:
            raise CloudReadError(
                f"{self._path.name}: none of its {len(self.topics)} topics holds clouds or depth images"
            )
        if len(usable) > 1:
            raise CloudReadError(f"{self._path.name}: say by --topic which to read: {listed}")
        return usable[0]

    def clouds(
        self,
        topic: BagTopic,
        options: ReadOptions = DEFAULT_OPTIONS,
        camera_info_topic: str | None = None,
        every: int = 1,
    ) -> Iterator[StampedCloud]:
        """Read the clouds of a topic in the order of recording.

        Args:
            topic: of `choose`.
            options: as of cloud files and depth images; the frame is that of the clouds.
            camera_info_topic: camera of depth images. If not given it is that of the options, or else that of the
                topic `camera_info` beside the images.
            every: read every first, second, ... message only.

        Raises:
            CameraError: depth images without a camera.
            CloudReadError: the bag is damaged from here on; a single unreadable message is a `StampedCloud` and no
                reason to stop.
        """
        convert = self._converter(topic, options, camera_info_topic)
        for log_ns, raw in islice(self._raw_messages(topic.name), 0, None, every):
            yield self._stamped(log_ns, raw, topic.type, convert)

    def _complaint(self, name: str) -> str:
        """Why a topic cannot be read, or nothing; what images hold is only told by the first of them."""
        topic = next((topic for topic in self.topics if topic.name == name), None)
        if topic is None:
            return "is not in this bag"
        if topic.messages == 0:
            return "holds no messages"
        if topic.type not in (CLOUD, IMAGE, COMPRESSED_IMAGE):
            return f"holds {_short(topic.type)} messages"
        if topic.type != CLOUD:
            try:
                message = self._first(topic)
                if topic.type == IMAGE:
                    check_encoding(message.encoding)
                else:
                    check_compressed_format(message.format)
            except CloudReadError as error:
                return str(error)
        return ""

    def _raw_messages(self, name: str) -> Iterator[tuple[int, bytes]]:
        connections = [connection for connection in self._reader.connections if connection.topic == name]
        with _one_line(self._path, "damaged from here on"):
            for _, log_ns, raw in self._reader.messages(connections):
                yield int(log_ns), raw

    def _first(self, topic: BagTopic) -> Any:
        _, raw = next(self._raw_messages(topic.name), (0, b""))
        with _one_line(self._path, f"damaged message of {topic.name}"):
            return self._message(raw, topic.type)

    def _message(self, raw: bytes, message_type: str) -> Any:
        return self._deserialize(unpack_zstd(raw) if raw[:4] == _ZSTD else raw, message_type)

    def _stamped(
        self, log_ns: int, raw: bytes, message_type: str, convert: Callable[[Any], Points]
    ) -> StampedCloud:
        stamp_ns, frame_id = log_ns, ""
        cloud: Points | DoorstateError
        try:
            message = self._message(raw, message_type)
            stamp_ns = stamp_ns_of(message) or log_ns
            frame_id = message.header.frame_id
            cloud = convert(message)
        except DoorstateError as error:
            cloud = error
        except Exception as error:  # whatever rosbags and Pillow make of foreign bytes
            cloud = CloudReadError(f"damaged message ({summarize_exception(error)})")
        return StampedCloud(stamp_ns / 1e9, frame_id, cloud)

    def _converter(
        self, topic: BagTopic, options: ReadOptions, camera_info_topic: str | None
    ) -> Callable[[Any], Points]:
        if topic.type != CLOUD and (camera_info_topic is not None or options.intrinsics is None):
            camera = self._camera(camera_info_topic or _camera_info_beside(topic.name))
            options = replace(options, intrinsics=camera)
        return lambda message: points_from_message(message, topic.type, options)

    def _camera(self, name: str) -> Intrinsics:
        topic = next(
            (topic for topic in self.topics if (topic.name, topic.type) == (name, CAMERA_INFO)), None
        )
        if topic is None or topic.messages == 0:
            raise CameraError(
                f"{self._path.name}: no CameraInfo in {name}, which depth images need: "
                "give --camera-info-topic, --intrinsics FILE or --fx --fy --cx --cy"
            )
        info = self._first(topic)
        try:
            return intrinsics_from_message(info)
        except CameraError as error:
            raise CameraError(f"{self._path.name}: {name}: {error}") from error


def _camera_info_beside(topic: str) -> str:
    return topic.removesuffix(_COMPRESSED_DEPTH).rpartition("/")[0] + "/camera_info"


def _short(message_type: str) -> str:
    return message_type.rpartition("/")[2]


@contextmanager
def _one_line(path: Path, complaint: str) -> Iterator[None]:
    """Foreign bytes make rosbags raise anything; to the user it is one thing."""
    try:
        yield
    except DoorstateError:
        raise
    except Exception as error:
        raise CloudReadError(f"{path.name}: {complaint} ({summarize_exception(error)})") from error
