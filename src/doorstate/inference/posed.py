# SPDX-License-Identifier: Apache-2.0
"""Predictions for clouds that were read with the pose of their camera."""

from __future__ import annotations

from doorstate.inference.known import DoorKnown
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.io.sensor_pose import SensorPose
from doorstate.types import Points


def predict_posed(
    predictor: Predictor, points: Points, pose: SensorPose | None, door_known: DoorKnown = False
) -> Prediction:
    """Return the prediction for points in the body frame; a tilt that is only assumed is left to be found.

    Args:
        predictor: network or rule.
        points: (N, 3) or (H, W, 3) metres.
        pose: pose that was applied to the points; None for simulated ones, which are level.
        door_known: as in `Predictor.__call__`.

    Raises:
        CloudContentError, ConfigError: as in `Predictor.__call__`.
    """
    is_level = pose is None or pose.is_tilt_known
    height_m = None if pose is None else pose.camera_height_m
    return predictor(points, door_known=door_known, is_level=is_level, camera_height_m=height_m)
