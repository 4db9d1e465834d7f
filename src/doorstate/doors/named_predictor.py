# SPDX-License-Identifier: Apache-2.0
"""Predictions with the names of doors: the doors of a cloud, those that are asked for at their places, and events."""

from __future__ import annotations

from typing import NamedTuple

from doorstate.doors.camera_place import CameraPlace, MissingPlace
from doorstate.doors.sighting import View
from doorstate.doors.tracker import DoorTracker, TrackedFrame
from doorstate.inference.door import Door
from doorstate.inference.known import DoorHint
from doorstate.inference.posed import predict_posed
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.io.sensor_pose import SensorPose
from doorstate.types import Points

_LEAST_PROBABILITY = 0.1  # of a door that was asked for


class NamedPrediction(NamedTuple):
    """Prediction for one cloud, and what it says of the doors of a list."""

    prediction: Prediction
    tracked: TrackedFrame


def predict_named(
    predictor: Predictor,
    points: Points,
    pose: SensorPose | None,
    tracker: DoorTracker,
    camera: CameraPlace | MissingPlace,
    stamp_s: float,
    *,
    frame: str = "",
    asks: bool = False,
) -> NamedPrediction:
    """Predict a cloud, and match its doors to those of a tracker.

    Args:
        predictor: weights for doorways; other methods find one door, and cannot be asked.
        points: points in the body frame, as read.
        pose: pose that was applied to the points; None for level ones.
        tracker: doors of the list.
        camera: pose of the camera in the map.
        stamp_s: time of the cloud.
        frame: name of the cloud, for events.
        asks: ask for doors in view that were not found, at the cost of one more prediction for each.

    Raises:
        CloudContentError, ConfigError: as in `Predictor.__call__`.
    """
    prediction = predict_posed(predictor, points, pose)
    tracked = name_doors(
        prediction, predictor, points, pose, tracker, camera, stamp_s, frame=frame, asks=asks
    )
    return NamedPrediction(prediction, tracked)


def name_doors(
    prediction: Prediction,
    predictor: Predictor,
    points: Points,
    pose: SensorPose | None,
    tracker: DoorTracker,
    camera: CameraPlace | MissingPlace,
    stamp_s: float,
    *,
    frame: str = "",
    asks: bool = False,
) -> TrackedFrame:
    """Match the doors of a prediction that was made elsewhere; arguments and errors are those of `predict_named`."""

    def ask(hint: DoorHint) -> Door | None:
        answer = predict_posed(predictor, points, pose, hint)
        door = answer.doors[0] if answer.doors else None
        # A state where the network sees no door at all says nothing of a door that is hidden.
        is_door = door is not None and (
            door.door_probability is None or door.door_probability >= _LEAST_PROBABILITY
        )
        return door if is_door else None

    view = View.of(points, prediction.tilt)
    return tracker.update(prediction, camera, stamp_s, view, frame=frame, ask=ask if asks else None)
