# SPDX-License-Identifier: Apache-2.0
"""Watch over a door: a report after every message of one camera. Needs no ROS."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.floor import lowest_z_m
from doorstate.clouds.measured import is_measured
from doorstate.errors import CameraError, DoorstateError, summarize_exception
from doorstate.inference.abstention import Abstention
from doorstate.inference.door_lines import door_lines
from doorstate.inference.door_report import DoorPose, DoorReport
from doorstate.inference.posed import predict_posed
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.inference.state_filter import StateFilter
from doorstate.inference.waiting import HoldTimer
from doorstate.inference.watch_settings import MESSAGE_TYPES, WatchSettings
from doorstate.io.calibration import calibration_from_message, is_rectified
from doorstate.io.camera import Intrinsics
from doorstate.io.messages import CLOUD, cloud_from_message, stamp_ns_of
from doorstate.io.options import DEFAULT_OPTIONS
from doorstate.io.rotations import Quaternion
from doorstate.io.sensor_pose import PosedCloud, SensorPose
from doorstate.rules.base import Detection
from doorstate.types import DoorState, Points

_SAMPLE_POINTS = 4096  # are enough for a median


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
        self._door_known = settings.known_door()
        self._predictor = predictor or settings.load_predictor()
        self._camera: Intrinsics | CameraError = CameraError("no CameraInfo has come yet")
        self._due_s = -math.inf
        self._frame_id = ""
        self._reset()

    @property
    def predictor(self) -> Predictor:
        """Network or rule."""
        return self._predictor

    @property
    def predictor_name(self) -> str:
        """Description of the network or rule, for a log."""
        return str(self._predictor)

    def change(self, settings: WatchSettings) -> None:
        """Use other settings from the next message on; what came earlier is forgotten where clouds are read otherwise.

        Input, network and rule stay as they are.

        Raises:
            DoorstateError: an impossible value.
        """
        options, door_known = settings.read_options(), settings.known_door()
        if (options, door_known) != (self._options, self._door_known):
            self._reset()
        self._settings, self._options, self._door_known = settings, options, door_known

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
        return self.report(lambda: self.cloud(message), stamp_ns, str(message.header.frame_id))

    def cloud(self, message: Any, rotation: Quaternion | None = None) -> PosedCloud:
        """Return the cloud of a message in the body frame.

        Args:
            message: message of the topic.
            rotation: from the frame of the message to a level frame, in place of the tilt of the settings.

        Raises:
            DoorstateError: the message cannot be read, or an image has no camera yet.
        """
        options = self._options
        if rotation is not None:
            options = replace(options, quaternion=rotation, roll_deg=None, pitch_deg=None)
        if self._type != CLOUD:
            if isinstance(self._camera, CameraError):
                raise self._camera
            options = replace(options, intrinsics=self._camera)
        return cloud_from_message(message, self._type, options)

    def report(
        self, read: Callable[[], PosedCloud], stamp_ns: int, frame_id: str, steady_s: float | None = None
    ) -> DoorReport:
        """Return the report after a cloud; one that cannot be read is unknown, with the reason.

        Args:
            read: returns the cloud in the body frame.
            stamp_ns: its time.
            frame_id: frame of the cloud as stored.
            steady_s: its time by a clock that never jumps, for filter and hold; None: as `stamp_ns`.
        """
        stamp_s = stamp_ns / 1e9 if steady_s is None else steady_s
        self._frame_id = frame_id
        seen = self._predict(read)
        prediction = seen.prediction
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
            has_held and prediction.confirms(DoorState.OPEN, require_leaf=self._settings.require_leaf),
            seen.to_message(seen.centre_m),
            tuple(
                Detection(detection.name, seen.pose.from_body(detection.points_m))
                for detection in prediction.detections
            ),
            tuple(
                line._replace(points_m=seen.to_message(line.points_m))
                for line in door_lines(prediction, seen.floor_z_m)
            ),
            tuple(DoorPose.of(door, seen.floor_z_m, seen.to_message) for door in prediction.doors),
            seen.pose,
        )

    def report_silence(self, now_ns: int, abstention: Abstention | None = None) -> DoorReport:
        """Return the report when nothing has come: unknown, and what came earlier is forgotten.

        Args:
            now_ns: time of the report.
            abstention: reason; None: no message for `silence_s`.
        """
        self._reset()
        silence = Abstention("no_message", {"silence_s": self._settings.silence_s})
        prediction = Prediction.abstain(abstention or silence)
        filtered = StateFilter().update(prediction, now_ns / 1e9)
        return DoorReport(now_ns, self._frame_id, prediction, filtered, None, False, np.zeros(3))

    def _reset(self) -> None:
        self._filter, self._hold_timer = StateFilter(), HoldTimer()
        self._last_state_s = -math.inf

    def _predict(self, read: Callable[[], PosedCloud]) -> _Seen:
        """Return the prediction for a cloud, with the pose of its camera and the places of its points."""
        sample, pose = np.empty((0, 3), np.float32), DEFAULT_OPTIONS.pose()
        try:
            points, pose = read()
            sample = _sample(points)
            return _Seen(sample, pose, predict_posed(self._predictor, points, pose, self._door_known))
        except DoorstateError as error:
            abstention = Abstention.from_error(error)
        except Exception as error:  # libraries raise anything for foreign bytes; a robot's node must go on
            sentence = f"damaged message ({summarize_exception(error)})"
            abstention = Abstention("damaged_message", message=sentence)
        return _Seen(sample, pose, Prediction.abstain(abstention))


class _Seen(NamedTuple):
    """Prediction for one message."""

    sample: Points  # (M, 3) measured points in the body frame; none without a readable message
    pose: SensorPose
    prediction: Prediction

    def to_message(self, points: NDArray[Any]) -> NDArray[np.float64]:
        """Return points (..., 3) of the level sensor frame in the frame of the message."""
        tilt = self.prediction.tilt
        return self.pose.from_body(points if tilt is None else tilt.from_level(points))

    @property
    def _level(self) -> NDArray[Any]:
        return self.sample if self.prediction.tilt is None else self.prediction.tilt.to_level(self.sample)

    @property
    def centre_m(self) -> NDArray[Any]:
        """(3,) median of the points in the level sensor frame; the camera without any."""
        return np.median(self._level, axis=0) if len(self.sample) else np.zeros(3)

    @property
    def floor_z_m(self) -> float:
        """Height of the lowest points in the level sensor frame."""
        return lowest_z_m(self._level) if len(self.sample) else 0.0


def _sample(points: Points) -> Points:
    flat = points.reshape(-1, 3)
    sample = flat[:: max(1, len(flat) // _SAMPLE_POINTS)]
    return sample[is_measured(sample)]
