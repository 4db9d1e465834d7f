# SPDX-License-Identifier: Apache-2.0
"""Labelling of frames one after the other: proposals, saving, undo, and where to go on."""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import MAX_NAME_LENGTH, FrozenModel
from doorstate.clouds.stillness import Rays, coarse_rays
from doorstate.dataset.frame_index import MOMENT_COLUMN
from doorstate.dataset.frame_labels import DoorLabel, LabelIndex, Labels, Lines
from doorstate.doorways.still_view import is_still
from doorstate.errors import DatasetError, DoorstateError, WriteParameter, python_parameter
from doorstate.inference.known import DoorHint
from doorstate.types import LABELS, DoorState
from doorstate.viewer.frame_sources import TOPIC_COLUMN, FrameSource
from doorstate.viewer.label_frame import LabelFrame, encode_doorway, hint_of_box, open_frame, unreadable

_KEPT_FRAMES, _KEPT_RAYS = 4, 300  # of a few MB and 80 kB

Number = Annotated[float, Field(ge=-1e4, le=1e4)]


class GivenPlace(FrozenModel):
    """Place of a door, as the page sends it."""

    x_m: Number
    y_m: Number
    yaw_deg: Number
    width_m: Number
    floor_z_m: Number


class GivenLabel(FrozenModel):
    """Label of a door or of a frame, as the page sends it."""

    state: DoorState | Literal["no_door", "unknown"]
    door: str = Field(default="", max_length=MAX_NAME_LENGTH)
    place: GivenPlace | None = None


class GivenLabels(FrozenModel):
    """Labels of a frame."""

    labels: list[GivenLabel] = Field(min_length=1, max_length=20)
    overwrite: bool = False  # labels that were there before the session


class GivenBox(FrozenModel):
    """Box in the image of a frame, in pixels."""

    box: tuple[Number, Number, Number, Number]


class LabelledBeforeError(DatasetError):
    """A frame has labels from before the session, and nothing told to overwrite them."""


class _View(NamedTuple):
    rays: Rays
    rotation: NDArray[np.float64] | None  # None until the frame was searched for doorways


class LabelSession:
    """Frames, their index, and the changes since the start. For one thread at a time.

    Args:
        source: frames.
        index: index of the folder of the source.
        parameter: how errors write parameters.

    Raises:
        DatasetError: the index is damaged, or of another topic of a bag.
    """

    def __init__(
        self, source: FrameSource, index: LabelIndex, parameter: WriteParameter = python_parameter
    ) -> None:
        self._source, self._index, self._parameter = source, index, parameter
        self._numbers = {name: number for number, name in enumerate(source.names)}
        self._before = set(index.labels())
        self._undo: list[tuple[int, Lines, bool]] = []
        self._frames: OrderedDict[int, LabelFrame | DoorstateError] = OrderedDict()
        self._views: OrderedDict[int, _View] = OrderedDict()
        topic = source.topic_name
        others = {text for text in index.column(TOPIC_COLUMN).values() if topic and text not in ("", topic)}
        if others:
            raise DatasetError(
                f"holds labels of the topic {min(others)}",
                path=index.path,
                field="topic",
                expected=topic,
                suggestions={"out": None},
            )

    @property
    def labelled(self) -> int:
        """Frames of the source that have labels."""
        return sum(name in self._numbers for name in self._index.labels())

    def counts(self) -> dict[str, int]:
        """Return the labels of the frames of the source by state, the most frequent first."""
        labels = self._index.labels().items()
        states = [label.state for name, each in labels if name in self._numbers for label in each]
        return dict(Counter(states).most_common())

    def start(self) -> int:
        """Return the number of the first frame without a label after the last one with, or of the last frame."""
        last = max((self._numbers.get(name, -1) for name in self._index.labels()), default=-1)
        return min(last + 1, len(self._source.names) - 1)

    def show(self, number: int) -> dict[str, Any]:
        """Return a frame as the page gets it.

        Raises:
            DatasetError: the index cannot be read any more.
        """
        all_labels = self._index.labels()
        name = self._source.names[number]
        labels = all_labels.get(name, ())
        previous = None if labels else self._labelled_before(number, all_labels)
        if previous is not None:
            self._view(previous)  # a bag is read forwards
        frame = self.open(number)
        entry = {
            "number": number,
            "name": name,
            "count": len(self._source.names),
            "labelled": sum(other in self._numbers for other in all_labels),
            "doors": sorted({label.door for each in all_labels.values() for label in each if label.door}),
            "labels": _encode(labels),
            "labelled_before": name in self._before and bool(labels),
            "proposed": [],
        }
        if isinstance(frame, DoorstateError):
            return entry | unreadable(frame, self._parameter)
        if previous is not None:
            earlier = all_labels[self._source.names[previous]]
            is_known = all(
                label.state in LABELS for label in earlier
            )  # other words are left to who wrote them
            if is_known and self._is_still(previous, number, earlier):
                entry |= {"proposed": _encode(earlier), "proposed_from": self._source.names[previous]}
        return entry | dict(frame.page)

    def save(self, number: int, given: GivenLabels) -> None:
        """Write the labels of a frame.

        Raises:
            LabelledBeforeError: the frame was labelled before the session, and `overwrite` is not set.
            ConfigError: a place is impossible.
            DoorstateError: the frame cannot be read, or a file cannot be written.
        """
        name = self._source.names[number]
        all_labels = self._index.labels()
        if name in self._before and name in all_labels and not given.overwrite:
            raise LabelledBeforeError("was labelled before", path=name)
        frame = self.open(number)
        if isinstance(frame, DoorstateError):
            raise frame
        labels = tuple(_decode(label, frame) for label in given.labels)
        lines = self._index.lines(name)
        self._index.replace(name, labels, self._moment(number, all_labels, labels), self._source.keep(number))
        self._undo.append((number, lines, name in self._before))
        self._before.discard(name)

    def undo(self) -> int | None:
        """Take back the last change, and return the number of its frame; None without one."""
        if not self._undo:
            return None
        number, lines, was_before = self._undo[-1]
        name = self._source.names[number]
        self._index.restore(name, lines)
        self._undo.pop()
        if was_before:
            self._before.add(name)
        return number

    def place(self, number: int, box: GivenBox) -> dict[str, float]:
        """Return the doorway between what was measured at both sides of a box in the image.

        Raises:
            ConfigError: no image, or nothing was measured there.
            DoorstateError: the frame cannot be read.
        """
        frame = self.open(number)
        if isinstance(frame, DoorstateError):
            raise frame
        return encode_doorway(frame.place(hint_of_box(*box.box)))

    def open(self, number: int) -> LabelFrame | DoorstateError:
        """Read a frame and find its doorways, or return why it cannot be read; the last few are kept."""
        if number not in self._frames:
            frame: LabelFrame | DoorstateError
            try:
                frame = open_frame(self._source.read(number), self._source.colour(number), self._parameter)
                self._views[number] = _View(frame.rays, frame.rotation)
            except DoorstateError as error:
                frame = error
            self._frames[number] = frame
        self._frames.move_to_end(number)
        _shorten(self._frames, _KEPT_FRAMES)
        _shorten(self._views, _KEPT_RAYS)
        return self._frames[number]

    def _view(self, number: int) -> _View | None:
        if number not in self._views:
            try:
                self._views[number] = _View(coarse_rays(self._source.read(number).points), None)
            except DoorstateError:
                return None
        return self._views[number]

    def _labelled_before(self, number: int, labels: Mapping[str, Labels]) -> int | None:
        """Return the number of the nearest labelled frame before a frame."""
        names = self._source.names
        return next((other for other in range(number - 1, -1, -1) if names[other] in labels), None)

    def _is_still(self, before: int, number: int, labels: Labels) -> bool:
        first, second = self._view(before), self._view(number)
        if first is None or second is None:
            return False
        doorways = [label.doorway for label in labels if label.doorway is not None]
        rotation = second.rotation if first.rotation is None else first.rotation
        return is_still(first.rays, second.rays, doorways, rotation)

    def _moment(self, number: int, all_labels: Mapping[str, Labels], labels: Labels) -> str:
        """Return the name of the still view: that of the labelled frame before, if hardly anything has changed."""
        own = PurePosixPath(self._source.names[number]).with_suffix("").as_posix()
        before = self._labelled_before(number, all_labels)
        if before is None or not self._is_still(before, number, labels):
            return own
        return self._index.column(MOMENT_COLUMN).get(self._source.names[before]) or own


def _encode(labels: Labels) -> list[dict[str, Any]]:
    return [
        {
            "state": label.state,
            "door": label.door,
            "place": None if label.doorway is None else encode_doorway(label.doorway),
        }
        for label in labels
    ]


def _decode(given: GivenLabel, frame: LabelFrame) -> DoorLabel:
    if given.place is None:
        return DoorLabel(str(given.state), given.door.strip())
    place = given.place
    hint = DoorHint(place.x_m, place.y_m, place.yaw_deg, place.width_m)
    return DoorLabel(str(given.state), given.door.strip(), frame.place(hint))


def _shorten(kept: OrderedDict[int, Any], most: int) -> None:
    while len(kept) > most:
        kept.popitem(last=False)
