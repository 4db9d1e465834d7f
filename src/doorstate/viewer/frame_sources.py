# SPDX-License-Identifier: Apache-2.0
"""Frames to label, by number: the files of a folder, or the messages of a bag."""

from __future__ import annotations

import io
from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Protocol

import numpy as np

from doorstate._files import atomic_path
from doorstate._paths import resolve_inside
from doorstate.dataset.frame_index import IndexedOptions
from doorstate.dataset.frame_labels import LabelIndex
from doorstate.errors import CloudReadError, DatasetError
from doorstate.io.bags import Bag, StampedCloud, open_bag
from doorstate.io.camera import Intrinsics
from doorstate.io.find import find_clouds
from doorstate.io.options import AUTO, ReadOptions
from doorstate.io.readers import read_posed_cloud
from doorstate.io.sensor_pose import PosedCloud

_COLOUR_SUFFIXES = (".jpg", ".jpeg", ".png")
_KEPT_MESSAGES = 6  # of a few MB
TOPIC_COLUMN, STAMP_COLUMN = "topic", "stamp_s"


class FrameSource(Protocol):
    """Frames with names that an index can hold."""

    @property
    def names(self) -> Sequence[str]:
        """Files of the frames, relative to the folder of the index."""

    @property
    def topic_name(self) -> str:
        """Topic of a bag; empty for a folder."""

    def read(self, number: int) -> PosedCloud:
        """Read a frame.

        Raises:
            DoorstateError: it cannot be read.
        """

    def colour(self, number: int) -> Path | None:
        """Return the colour image of a frame, if there is one."""

    def keep(self, number: int) -> Mapping[str, str]:
        """Make sure that the file of a frame exists, and return the columns with which it is read as it was here."""

    def close(self) -> None:
        """Close the recording."""


class FolderFrames:
    """Cloud files and depth images of a folder.

    Args:
        folder: folder; its `index.csv`, if any, gives cameras.
        options: how files are read that the index does not describe.
        every: take one of this number of files.
    """

    def __init__(self, folder: Path, options: ReadOptions, every: int = 1) -> None:
        self._folder = folder
        self._paths = find_clouds([folder])[::every]
        self._colours = LabelIndex(folder).column("rgb")
        self.names: Sequence[str] = [path.relative_to(folder).as_posix() for path in self._paths]
        self.topic_name = ""
        self._options = IndexedOptions(options)

    def close(self) -> None:
        """Do nothing: files are closed when they have been read."""

    def read(self, number: int) -> PosedCloud:
        """Read a file."""
        path = self._paths[number]
        return read_posed_cloud(path, self._options.of(path))

    def colour(self, number: int) -> Path | None:
        """Return the image that the index names, or `NAME_rgb` beside a file."""
        path = self._paths[number]
        if named := self._colours.get(self.names[number]):
            with suppress(DatasetError):  # outside of the folder
                return resolve_inside(self._folder, named)
        beside = (path.with_name(f"{path.stem}_rgb{suffix}") for suffix in _COLOUR_SUFFIXES)
        return next((image for image in beside if image.is_file()), None)

    def keep(self, number: int) -> Mapping[str, str]:
        """Return the camera and the colour image; the file exists."""
        colour = self.colour(number)
        columns = option_columns(self._options.of(self._paths[number]))
        return columns if colour is None else columns | {"rgb": colour.relative_to(self._folder).as_posix()}


class BagFrames:
    """Messages of one topic of a bag; those that are labelled are written as files into a folder.

    Args:
        path: bag.
        folder: folder of the index and of the files.
        topic: topic of clouds or depth images, if the bag has several.
        camera_info_topic: topic of the camera.
        options: how messages are read.
        every: take one of this number of messages.

    Raises:
        CloudReadError: no bag, or no such topic.
    """

    def __init__(
        self,
        path: Path,
        folder: Path,
        options: ReadOptions,
        topic: str | None = None,
        camera_info_topic: str | None = None,
        every: int = 1,
    ) -> None:
        self._path, self._folder, self._options = path, folder, options
        self._camera_info_topic, self._every = camera_info_topic, every
        self._stack = ExitStack()
        self._bag: Bag = self._stack.enter_context(open_bag(path))
        self._topic = self._bag.choose(topic)
        self.topic_name = self._topic.name
        self.names: Sequence[str] = [
            f"frame-{number:06d}.npz" for number in range(0, self._topic.messages, every)
        ]
        self._messages: Iterator[StampedCloud] = iter(())
        self._next = -1  # number of the frame that `_messages` yields next
        self._last: OrderedDict[int, StampedCloud] = (
            OrderedDict()
        )  # the next frame is read before one is labelled

    def close(self) -> None:
        """Close the bag."""
        self._stack.close()

    def read(self, number: int) -> PosedCloud:
        """Read a message; the ones before it are passed over, and read again to go back."""
        message = self._message(number)
        if isinstance(message.cloud, Exception):
            raise message.cloud
        assert message.pose is not None
        return PosedCloud(message.cloud, message.pose)

    def colour(self, number: int) -> Path | None:
        """Return None: colour topics are not read."""

    def keep(self, number: int) -> Mapping[str, str]:
        """Write the points of a message, level where the tilt is known, unless the file exists."""
        points, pose = self.read(number)
        path = self._folder / self.names[number]
        if not path.exists():
            content = io.BytesIO()
            np.savez_compressed(content, points=points)
            with atomic_path(path) as temporary:
                temporary.write_bytes(content.getvalue())
        columns = {TOPIC_COLUMN: self._topic.name, STAMP_COLUMN: f"{self._message(number).stamp_s:.6f}"}
        if pose.is_tilt_known:
            columns |= {"roll_deg": "0", "pitch_deg": "0"}
        if pose.camera_height_m is not None:
            columns["camera_height_m"] = _text(pose.camera_height_m)
        return columns

    def _message(self, number: int) -> StampedCloud:
        if number in self._last:
            return self._last[number]
        if number != self._next:
            self._messages = self._bag.clouds(
                self._topic, self._options, self._camera_info_topic, self._every, number * self._every
            )
        self._next = -1  # if the bag is damaged from here on
        message = next(self._messages, None)
        if message is None:
            raise CloudReadError("has fewer messages than its index tells", path=self._path)
        self._next, self._last[number] = number + 1, message
        if len(self._last) > _KEPT_MESSAGES:
            self._last.popitem(last=False)
        return message


def option_columns(options: ReadOptions) -> dict[str, str]:
    """Return the columns of an index that stand for reading options; a lens and the unit of clouds have none."""
    columns: dict[str, str] = {}
    camera = options.intrinsics
    if camera is not None and getattr(camera, "distortion", None) is None:
        columns = {name: _text(getattr(camera, name)) for name in ("fx", "fy", "cx", "cy")}
        if isinstance(camera, Intrinsics):
            columns |= {"width": str(camera.width), "height": str(camera.height)}
    if options.depth_scale_m != ReadOptions.depth_scale_m:
        columns["depth_unit_m"] = _text(options.depth_scale_m)
    if options.axes != AUTO:
        columns["axes"] = options.axes
    for name in ("roll_deg", "pitch_deg", "camera_height_m"):
        if (value := getattr(options, name)) is not None:
            columns[name] = _text(value)
    if options.quaternion is not None:
        columns["quaternion"] = " ".join(map(_text, options.quaternion))
    return columns


def _text(value: float) -> str:
    """Return a number with all of its digits."""
    return str(float(value)).removesuffix(".0")
