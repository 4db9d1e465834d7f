# SPDX-License-Identifier: Apache-2.0
"""How an answer is worded for other programs: by the command line and by the service."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from doorstate.deployment.predictor import Prediction


def described(prediction: Prediction) -> dict[str, Any]:
    """A prediction as JSON takes it."""
    return {
        "state": None if prediction.state is None else prediction.state.label,
        "probabilities": {state: round(p, 6) for state, p in prediction.probabilities.items()},
        "points": prediction.points,
        "milliseconds": round(prediction.milliseconds, 3),
        **({"reason": prediction.reason} if prediction.state is None else {}),
        **{name: value for name, value in _further(prediction).items() if value is not None},
    }


def _further(prediction: Prediction) -> dict[str, Any]:
    """What some methods say besides the state."""
    frame = prediction.frame
    return {
        "door_probability": _rounded(prediction.door_probability, 4),
        "opening_angle_deg": _rounded(prediction.opening_angle_deg, 1),
        "hinge": prediction.hinge,
        "door_x_m": None if frame is None else round(frame.x_m, 3),
        "door_y_m": None if frame is None else round(frame.y_m, 3),
        "door_yaw_deg": None if frame is None else round(frame.yaw_deg, 1),
        "opening_width_m": _rounded(prediction.opening_width_m, 3),
        "passable_width_m": _rounded(prediction.passable_width_m, 3),
    }


def _rounded(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)
