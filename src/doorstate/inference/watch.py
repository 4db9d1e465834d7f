# SPDX-License-Identifier: Apache-2.0
"""Watch over a door: a report after every message of one camera. Needs no ROS."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from doorstate.clouds.measured import is_measured
from doorstate.errors import CameraError, DoorstateError, summarize_exception
from doorstate.inference.abstention import Abstention
from doorstate.inference.door_report import DoorReport
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.inference.state_filter import StateFilter
from doorstate.inference.waiting import HoldTimer
from doorstate.inference.watch_settings import MESSAGE_TYPES, WatchSettings
from doorstate.io.calibration import calibration_from_message, is_rectified
from doorstate.io.camera import Intrinsics
from doorstate.io.messages import CLOUD, cloud_from_message, stamp_ns_of
from doorstate.io.options import DEFAULT_OPTIONS
from doorstate.io.sensor_pose import PosedCloud, SensorPose
from doorstate.rules.base import Detection
from doorstate.types import DoorState, Points

_CENTRE_POINTS = 4096  # are enough for a median


class DoorWatch:
    """Read the messages of one topic, predict, filter, and report.

    Not for several threads.

    Args:
        settings: how messages are read, and when the way is free.
        predictor: network or rule; None loads the one that the settings name.

    Raises:
        DoorstateError: as in `WatchSettings.load_predictor`.
    """

    def __init__(self, settings: WatchSettings, predictor: Predictor | None = None) -> None:
        self._settings = settings
        self._type = MESSAGE_TYPES[settings.input]
        self._options = settings.read_options()
        self._predictor = predictor or settings.load_predictor()
        self._camera: Intrinsics | CameraError = CameraError("no CameraInfo has come yet")
        self._due_s = -math.inf
        self._frame_id = ""
        self._reset()

    @property
    def predictor_name(self) -> str:
        """Description of the network or rule, for a log."""
        return str(self._predictor)

    def is_due(self, now_s: float) -> bool:
        """Return True if a message that comes now is to be processed, by `max_hz`.

        Args:
            now_s: seconds of any steady clock.
        """
        period_s = 1 / self._settings.max_hz if self._settings.max_hz else 0.0
        if now_s < self._due_s:
            return False
        self._due_s = max(self._due_s, now_s - period_s) + period_s
        return True

    def set_camera(self, info: Any, image_topic: str = "") -> None:
        """Use a CameraInfo for the images that come from now on; one that is not good does not replace a good one.

        Args:
            info: CameraInfo message.
            image_topic: name of the topic of the images, which tells if they are rectified.
        """
        rectified = is_rectified(image_topic) if self._options.rectified is None else self._options.rectified
        try:
            self._camera = calibration_from_message(info).camera(rectified)
        except CameraError as error:
            if isinstance(self._camera, CameraError):
                self._camera = error

    def process(self, message: Any, received_ns: int) -> DoorReport:
        """Return the report after a message; one that cannot be read is unknown, with the reason.

        Args:
            message: message of the topic, with the fields of its type.
            received_ns: stamp to use if the message has none.
        """
        stamp_ns = stamp_ns_of(message) or received_ns
        stamp_s = stamp_ns / 1e9
        self._frame_id = str(message.header.frame_id)
        centre, pose, prediction = self._predict(message)
        if prediction.state is not None:
            self._last_state_s = stamp_s
        elif stamp_s - self._last_state_s >= self._settings.silence_s:
            self._reset()
        filtered = self._filter.update(prediction, stamp_s)
        held_s = self._hold_timer.update(prediction, filtered, stamp_s)
        has_held = held_s is not None and held_s >= self._settings.hold_s
        return DoorReport(
            stamp_ns,
            self._frame_id,
            prediction,
            filtered,
            held_s,
            prediction.state is DoorState.OPEN and has_held,
            pose.from_body(centre),
            tuple(
                Detection(detection.name, pose.from_body(detection.points_m))
                for detection in prediction.detections
            ),
            pose,
        )

    def report_silence(self, now_ns: int) -> DoorReport:
        """Return the report when no message has come for `silence_s`: unknown, and earlier messages are forgotten."""
        self._reset()
        prediction = Prediction.abstain(Abstention("no_message", {"silence_s": self._settings.silence_s}))
        filtered = StateFilter().update(prediction, now_ns / 1e9)
        return DoorReport(now_ns, self._frame_id, prediction, filtered, None, False, np.zeros(3))

    def _reset(self) -> None:
        self._filter, self._hold_timer = StateFilter(), HoldTimer()
        self._last_state_s = -math.inf

    def _predict(self, message: Any) -> tuple[Points, SensorPose, Prediction]:
        """Return the centre (3,) of the measured points and the prediction, in the body frame, and the pose."""
        centre, pose = np.zeros(3, np.float32), DEFAULT_OPTIONS.pose()
        try:
            points, pose = self._cloud(message)
            centre = _centre_m(points)
            return centre, pose, self._predictor(points)
        except DoorstateError as error:
            abstention = Abstention.from_error(error)
        except Exception as error:  # libraries raise anything for foreign bytes; a robot's node must go on
            sentence = f"damaged message ({summarize_exception(error)})"
            abstention = Abstention("damaged_message", message=sentence)
        return centre, pose, Prediction.abstain(abstention)

    def _cloud(self, message: Any) -> PosedCloud:
        options = self._options
        if self._type != CLOUD:
            if isinstance(self._camera, CameraError):
                raise self._camera
            options = replace(options, intrinsics=self._camera)
        return cloud_from_message(message, self._type, options)


def _centre_m(points: Points) -> Points:
    """Return the (3,) median of the measured points; the camera if there are none."""
    flat = points.reshape(-1, 3)
    sample = flat[:: max(1, len(flat) // _CENTRE_POINTS)]
    sample = sample[is_measured(sample)]
    return np.median(sample, axis=0).astype(np.float32) if len(sample) else np.zeros(3, np.float32)
