# SPDX-License-Identifier: Apache-2.0
"""What a robot says of a door after every message of its camera; needs no ROS."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.measured import is_measured
from doorstate.errors import CameraError, DoorstateError, summarize_exception
from doorstate.inference.abstention import Abstention
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.inference.serialization import prediction_to_dict
from doorstate.inference.stream import FilteredState, Holding, StateFilter
from doorstate.inference.watch_settings import MESSAGE_TYPES, WatchSettings
from doorstate.io.camera import Intrinsics
from doorstate.io.depth import undo_roll
from doorstate.io.messages import (
    CLOUD,
    intrinsics_from_message,
    is_optical,
    points_from_message,
    stamp_ns_of,
)
from doorstate.io.options import ReadOptions
from doorstate.rules.base import Detection
from doorstate.types import DoorState, Points

UNKNOWN = "unknown"
_LOOKED_AT = 4096  # points, to find the middle of a cloud


@dataclass(frozen=True, eq=False)
class DoorReport:
    """What is said of a door at one moment."""

    stamp_ns: int
    frame_id: str  # as of the message
    prediction: Prediction  # of this message alone
    filtered: FilteredState  # of all so far
    held_s: float | None  # for how long filter and messages have agreed; None: this message does not
    is_open: bool  # and has been for long enough
    middle_m: NDArray[np.float64]  # (3,) of what was measured, in the frame of the message
    shapes: tuple[Detection, ...] = ()  # that a rule found, in the frame of the message

    @property
    def state(self) -> str:
        """The filter's state by name, or `unknown`."""
        return UNKNOWN if self.filtered.state is None else self.filtered.state.label

    @property
    def values(self) -> dict[str, str]:
        """Everything by name, as text: of this message alone, then after the filter."""
        said = prediction_to_dict(self.prediction)
        values = {"state": self.state, "raw_state": said.pop("state") or UNKNOWN, "reason": ""}
        values |= said.pop("probabilities") | said
        values |= {f"smoothed_{name}": round(p, 6) for name, p in self.filtered.probabilities.items()}
        values["held_s"] = 0.0 if self.held_s is None else round(self.held_s, 3)
        return {name: str(value) for name, value in values.items()}

    @property
    def text(self) -> str:
        """A label to be drawn beside the door; the reason under it where there is no answer."""
        state = self.filtered.state
        sure = "" if state is None else f" {self.filtered.probabilities[state.label]:.0%}"
        return f"{self.state}{sure}\n{self.prediction.reason}".strip()


class DoorWatch:
    """Reads the messages of one topic, asks, filters, and keeps in mind what the next answer depends on.

    One thread at a time.

    Args:
        settings: how messages are read and when the way is free.
        predictor: whom to ask; None: whom the settings say.

    Raises:
        DoorstateError: as of `WatchSettings.load_predictor`.
    """

    def __init__(self, settings: WatchSettings, predictor: Predictor | None = None) -> None:
        self._settings = settings
        self._type = MESSAGE_TYPES[settings.input]
        self._predictor = predictor or settings.load_predictor()
        self._camera: Intrinsics | CameraError = CameraError("no CameraInfo has come yet")
        self._due_s = -math.inf
        self._frame_id = ""
        self._start_anew()

    @property
    def answerer(self) -> str:
        """Who answers, for a log."""
        return str(self._predictor)

    def is_due(self, now_s: float) -> bool:
        """Whether a message that comes now is to be answered, by `max_hz`; the seconds are of any steady clock."""
        period_s = 1 / self._settings.max_hz if self._settings.max_hz else 0.0
        if now_s < self._due_s:
            return False
        self._due_s = max(self._due_s, now_s - period_s) + period_s
        return True

    def see_camera(self, info: Any) -> None:
        """Take in a CameraInfo: images that come now are of this camera."""
        try:
            self._camera = intrinsics_from_message(info)
        except CameraError as error:
            self._camera = error

    def answer(self, message: Any, received_ns: int) -> DoorReport:
        """What is said after a message; one that cannot be read is unknown, with the reason.

        Args:
            message: with the fields of its type.
            received_ns: its stamp if it has none of its own.
        """
        stamp_ns = stamp_ns_of(message) or received_ns
        self._frame_id = str(message.header.frame_id)
        options = self._settings.read_options(is_optical(self._frame_id))
        middle = np.zeros(3, np.float32)
        try:
            points = self._points(message, options)
            middle = _middle_m(points)
            prediction = self._predictor(points)
        except DoorstateError as error:
            prediction = Prediction.abstain(Abstention.from_error(error))
        except Exception as error:  # what libraries make of foreign bytes must not end a robot's node
            prediction = Prediction.abstain(
                Abstention("damaged_message", message=f"damaged message ({summarize_exception(error)})")
            )
        stamp_s = stamp_ns / 1e9
        if prediction.state is not None:
            self._seen_s = stamp_s
        elif stamp_s - self._seen_s >= self._settings.silence_s:
            self._start_anew()
        filtered = self._filter.update(prediction, stamp_s)
        held_s = self._holding.update(prediction, filtered, stamp_s)
        optical = self._type != CLOUD or options.frame == "optical"
        return DoorReport(
            stamp_ns,
            self._frame_id,
            prediction,
            filtered,
            held_s,
            prediction.state is DoorState.OPEN and held_s is not None and held_s >= self._settings.hold_s,
            _as_sent(middle, optical, options),
            tuple(
                Detection(found.name, _as_sent(found.points_m.astype(np.float32), optical, options))
                for found in prediction.detections
            ),
        )

    def silence(self, now_ns: int) -> DoorReport:
        """What is said when no message has come for `silence_s`: nothing is known any more."""
        self._start_anew()
        prediction = Prediction.abstain(Abstention("no_message", {"silence_s": self._settings.silence_s}))
        filtered = StateFilter().update(prediction, now_ns / 1e9)
        return DoorReport(now_ns, self._frame_id, prediction, filtered, None, False, np.zeros(3))

    def _start_anew(self) -> None:
        self._filter, self._holding = StateFilter(), Holding()
        self._seen_s = -math.inf  # the last message with a state

    def _points(self, message: Any, options: ReadOptions) -> Points:
        if self._type != CLOUD:
            if isinstance(self._camera, CameraError):
                raise self._camera
            options = replace(options, intrinsics=self._camera)
        return points_from_message(message, self._type, options)


def _middle_m(points: Points) -> Points:
    """(3,) median of what was measured, in the frame of the points; the camera where there is nothing."""
    flat = points.reshape(-1, 3)
    some = flat[:: max(1, len(flat) // _LOOKED_AT)]
    some = some[is_measured(some)]
    return np.median(some, axis=0).astype(np.float32) if len(some) else np.zeros(3, np.float32)


def _as_sent(points: Points, optical: bool, options: ReadOptions) -> NDArray[np.float64]:
    """Points (..., 3) of the body frame in that of the message, in metres."""
    turned = undo_roll(points, -options.roll_deg % 360).astype(np.float64)
    if not optical:
        return turned
    forward, left, up = np.moveaxis(turned, -1, 0)
    return np.stack((-left, -up, forward), axis=-1)
