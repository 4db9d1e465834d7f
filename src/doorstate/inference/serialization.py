# SPDX-License-Identifier: Apache-2.0
"""Predictions and doors as plain values for JSON and CSV, the same on the command line, over HTTP and on a robot."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, TypeVar

from doorstate.errors import TooFewPointsError, WriteParameter, python_parameter

if TYPE_CHECKING:
    from doorstate.inference.answer import StateAnswer
    from doorstate.inference.door import Door
    from doorstate.inference.prediction import Prediction
    from doorstate.io.sensor_pose import SensorPose

Value = float | str | bool | None
T = TypeVar("T")


def prediction_to_dict(
    prediction: Prediction,
    parameter: WriteParameter = python_parameter,
    pose: SensorPose | None = None,
) -> dict[str, Any]:
    """Return a prediction as JSON values; fields without a value are left out.

    `raw_probabilities` are those of a network whose state is refused. `doors` has every door, the one of the other
    fields first; it is left out without any. `tilt` is that of a camera whose tilt was found in the cloud.

    Args:
        prediction: prediction of a network or a rule.
        parameter: writes a parameter that a reason suggests as the surface spells it.
        pose: pose of the camera that was applied to the points, as the field `sensor_pose`.
    """
    record = _state(prediction)
    record |= {"points": prediction.num_points, "milliseconds": round(prediction.milliseconds, 3)}
    record |= _reason(prediction, parameter) | _given(OPTIONAL_FIELDS, prediction)
    if prediction.doors:
        record["doors"] = [door_to_dict(door, parameter) for door in prediction.doors]
    if prediction.tilt is not None:
        record["tilt"] = prediction.tilt.to_dict()
    return record if pose is None else record | {"sensor_pose": pose.to_dict()}


def door_to_dict(door: Door, parameter: WriteParameter = python_parameter) -> dict[str, Any]:
    """Return a door as JSON values, as `prediction_to_dict` does; place and width are in any door."""
    return _state(door) | _reason(door, parameter) | _given(DOOR_FIELDS, door)


def _state(answer: StateAnswer) -> dict[str, Any]:
    record: dict[str, Any] = {"state": None if answer.state is None else str(answer.state)}
    if answer.raw_probabilities is not None:
        name = "raw_probabilities" if answer.state is None else "probabilities"
        record[name] = {state: round(p, 6) for state, p in answer.raw_probabilities.items()}
    return record


def _reason(answer: StateAnswer, parameter: WriteParameter) -> dict[str, Any]:
    return {} if answer.abstention is None else {"reason": answer.abstention.describe(parameter)}


def _given(fields: Mapping[str, Callable[[T], Value]], answer: T) -> dict[str, Any]:
    values = {name: value(answer) for name, value in fields.items()}
    return {name: value for name, value in values.items() if value is not None}


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


OPTIONAL_FIELDS: dict[str, Callable[[Prediction], Value]] = {
    "door_probability": lambda prediction: _rounded(prediction.door_probability, 4),
    "opening_angle_deg": lambda prediction: _rounded(prediction.opening_angle_deg, 1),
    "hinge": lambda prediction: prediction.hinge,
    "hinge_probability": lambda prediction: _rounded(prediction.hinge_probability, 4),
    "door_x_m": lambda prediction: prediction.frame and round(prediction.frame.x_m, 3),
    "door_y_m": lambda prediction: prediction.frame and round(prediction.frame.y_m, 3),
    "door_yaw_deg": lambda prediction: prediction.frame and round(prediction.frame.yaw_deg, 1),
    "opening_width_m": lambda prediction: _rounded(prediction.opening_width_m, 3),
    "passable_width_m": lambda prediction: _rounded(prediction.passable_width_m, 3),
    "leaf_seen": lambda prediction: prediction.leaf_seen,
}
"""Fields that only some networks and rules predict, by name."""

DOOR_FIELDS: dict[str, Callable[[Door], Value]] = {
    "door_probability": lambda door: _rounded(door.door_probability, 4),
    "opening_angle_deg": lambda door: _rounded(door.opening_angle_deg, 1),
    "angle_error_deg": lambda door: _rounded(door.angle_error_deg, 1),
    "hinge": lambda door: door.hinge,
    "hinge_probability": lambda door: _rounded(door.hinge_probability, 4),
    "x_m": lambda door: round(door.x_m, 3),
    "y_m": lambda door: round(door.y_m, 3),
    "yaw_deg": lambda door: round(door.yaw_deg, 1),
    "position_error_m": lambda door: _rounded(door.position_error_m, 3),
    "yaw_error_deg": lambda door: _rounded(door.yaw_error_deg, 1),
    "width_m": lambda door: round(door.width_m, 3),
    "passable_width_m": lambda door: _rounded(door.passable_width_m, 3),
    "distance_m": lambda door: round(door.distance_m, 3),
    "bearing_deg": lambda door: round(door.bearing_deg, 1) + 0.0,  # no -0.0
    "leaf_seen": lambda door: door.leaf_seen,
    "score": lambda door: _rounded(door.score, 3),
}
"""Fields of a door besides its state, by name; values that its method does not estimate are left out."""
