# SPDX-License-Identifier: Apache-2.0
"""Predictions as plain values for JSON and CSV, the same on the command line, over HTTP and on a robot."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from doorstate.errors import TooFewPointsError, WriteParameter, python_parameter

if TYPE_CHECKING:
    from doorstate.inference.prediction import Prediction
    from doorstate.io.sensor_pose import SensorPose


def prediction_to_dict(
    prediction: Prediction,
    parameter: WriteParameter = python_parameter,
    pose: SensorPose | None = None,
) -> dict[str, Any]:
    """Return a prediction as JSON values; fields without a value are left out.

    `raw_probabilities` are those of a network whose state is refused.

    Args:
        prediction: prediction of a network or a rule.
        parameter: writes a parameter that a reason suggests as the surface spells it.
        pose: pose of the camera that was applied to the points, as the field `sensor_pose`.
    """
    record: dict[str, Any] = {"state": None if prediction.state is None else str(prediction.state)}
    if prediction.raw_probabilities is not None:
        name = "raw_probabilities" if prediction.state is None else "probabilities"
        record[name] = {state: round(p, 6) for state, p in prediction.raw_probabilities.items()}
    record |= {"points": prediction.num_points, "milliseconds": round(prediction.milliseconds, 3)}
    if prediction.abstention is not None:
        record["reason"] = prediction.abstention.describe(parameter)
    values = {name: value(prediction) for name, value in OPTIONAL_FIELDS.items()}
    record |= {name: value for name, value in values.items() if value is not None}
    return record if pose is None else record | {"sensor_pose": pose.to_dict()}


def require_points(prediction: Prediction) -> Prediction:
    """Return the prediction of a file, which must hold points; an empty frame of a stream is no error.

    Raises:
        TooFewPointsError: the prediction is based on no points.
    """
    if prediction.num_points == 0:
        error = None if prediction.abstention is None else prediction.abstention.error
        raise error or TooFewPointsError(prediction.reason)
    return prediction


def _rounded(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)


OPTIONAL_FIELDS: dict[str, Callable[[Prediction], float | str | None]] = {
    "door_probability": lambda prediction: _rounded(prediction.door_probability, 4),
    "opening_angle_deg": lambda prediction: _rounded(prediction.opening_angle_deg, 1),
    "hinge": lambda prediction: prediction.hinge,
    "hinge_probability": lambda prediction: _rounded(prediction.hinge_probability, 4),
    "door_x_m": lambda prediction: prediction.frame and round(prediction.frame.x_m, 3),
    "door_y_m": lambda prediction: prediction.frame and round(prediction.frame.y_m, 3),
    "door_yaw_deg": lambda prediction: prediction.frame and round(prediction.frame.yaw_deg, 1),
    "opening_width_m": lambda prediction: _rounded(prediction.opening_width_m, 3),
    "passable_width_m": lambda prediction: _rounded(prediction.passable_width_m, 3),
}
"""Fields that only some networks and rules predict, by name."""
