# SPDX-License-Identifier: Apache-2.0
"""Predictions and doors as plain values for JSON and CSV, the same on the command line, over HTTP and on a robot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from doorstate.errors import TooFewPointsError, WriteParameter, python_parameter

if TYPE_CHECKING:
    from doorstate.inference.answer import StateAnswer
    from doorstate.inference.door import Door
    from doorstate.inference.prediction import Prediction
    from doorstate.io.sensor_pose import SensorPose


def prediction_to_dict(
    prediction: Prediction,
    parameter: WriteParameter = python_parameter,
    pose: SensorPose | None = None,
) -> dict[str, Any]:
    """Return a prediction as JSON values, rounded; fields without a value are left out.

    `raw_probabilities` are those of a network whose state is refused. `doors` has every door, the one of the other
    fields first; it is left out without any. `tilt` is that of a camera whose tilt was found in the cloud.

    Args:
        prediction: prediction of a network or a rule.
        parameter: writes a parameter that a reason suggests as the surface spells it.
        pose: pose of the camera that was applied to the points, as the field `sensor_pose`.
    """
    return rounded(prediction_values(prediction, parameter, pose))


def prediction_values(
    prediction: Prediction,
    parameter: WriteParameter = python_parameter,
    pose: SensorPose | None = None,
) -> dict[str, Any]:
    """Return what `prediction_to_dict` does before it is rounded, for output that rounds further."""
    record = _state(prediction)
    record |= {"points": prediction.num_points, "milliseconds": prediction.milliseconds}
    x_m, y_m, yaw_deg = prediction.frame or (None, None, None)
    place = {"door_x_m": x_m, "door_y_m": y_m, "door_yaw_deg": yaw_deg}
    optional = {name: place[name] if name in place else getattr(prediction, name) for name in OPTIONAL_FIELDS}
    record |= _reason(prediction, parameter) | _given(optional)
    if prediction.doors:
        record["doors"] = [_door_values(door, parameter) for door in prediction.doors]
    if prediction.tilt is not None:
        record["tilt"] = prediction.tilt.to_dict()
    return record if pose is None else record | {"sensor_pose": pose.to_dict()}


def door_to_dict(door: Door, parameter: WriteParameter = python_parameter) -> dict[str, Any]:
    """Return a door as JSON values, as `prediction_to_dict` does; place and width are in any door."""
    return rounded(_door_values(door, parameter))


def rounded(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return `prediction_values`, or a row with them, as JSON and CSV have them."""
    values = {name: _round(value, _DECIMALS.get(name)) for name, value in record.items()}
    if "doors" in values:
        values["doors"] = [rounded(door) for door in values["doors"]]
    return values


def _round(value: Any, decimals: int | None) -> Any:
    if decimals is None or value is None:
        return value
    if isinstance(value, Mapping):
        return {state: _round(probability, decimals) for state, probability in value.items()}
    return round(value, decimals) + 0.0  # no -0.0


def _door_values(door: Door, parameter: WriteParameter) -> dict[str, Any]:
    values = _given({name: getattr(door, name) for name in DOOR_FIELDS})
    return _state(door) | _reason(door, parameter) | values


def _state(answer: StateAnswer) -> dict[str, Any]:
    record: dict[str, Any] = {"state": None if answer.state is None else str(answer.state)}
    if answer.raw_probabilities is not None:
        name = "raw_probabilities" if answer.state is None else "probabilities"
        record[name] = dict(answer.raw_probabilities)
    return record


def _reason(answer: StateAnswer, parameter: WriteParameter) -> dict[str, Any]:
    return {} if answer.abstention is None else {"reason": answer.abstention.describe(parameter)}


def _given(values: Mapping[str, Any]) -> dict[str, Any]:
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


OPTIONAL_FIELDS: dict[str, int | None] = {
    "door_probability": 4,
    "opening_angle_deg": 1,
    "hinge": None,
    "hinge_probability": 4,
    "door_x_m": 3,
    "door_y_m": 3,
    "door_yaw_deg": 1,
    "opening_width_m": 3,
    "passable_width_m": 3,
    "leaf_seen": None,
}
"""Fields that only some networks and rules predict, and the decimals of their numbers."""

DOOR_FIELDS: dict[str, int | None] = {
    "door_probability": 4,
    "opening_angle_deg": 1,
    "angle_error_deg": 1,
    "hinge": None,
    "hinge_probability": 4,
    "x_m": 3,
    "y_m": 3,
    "yaw_deg": 1,
    "position_error_m": 3,
    "yaw_error_deg": 1,
    "width_m": 3,
    "passable_width_m": 3,
    "distance_m": 3,
    "bearing_deg": 1,
    "leaf_seen": None,
    "score": 3,
}
"""Fields of a door besides its state, and the decimals of their numbers; values that are not estimated are left out."""

_DECIMALS = OPTIONAL_FIELDS | DOOR_FIELDS | {"probabilities": 6, "raw_probabilities": 6, "milliseconds": 3}
