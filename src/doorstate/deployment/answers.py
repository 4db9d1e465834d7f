# SPDX-License-Identifier: Apache-2.0
"""How an answer is worded for other programs: by the command line and by the service."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from doorstate.errors import TooFewPointsError

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
        **{
            name: value
            for name, value in zip(FURTHER, _further(prediction), strict=True)
            if value is not None
        },
    }


def described_file(prediction: Prediction) -> dict[str, Any]:
    """A prediction of a file as JSON takes it; one without points is broken, where a frame of a stream is unknown.

    Raises:
        TooFewPointsError: there was nothing to look at.
    """
    if prediction.points == 0:
        raise TooFewPointsError(prediction.reason)
    return described(prediction)


FURTHER = (
    "door_probability",
    "opening_angle_deg",
    "hinge",
    "door_x_m",
    "door_y_m",
    "door_yaw_deg",
    "opening_width_m",
    "passable_width_m",
)
"""What some methods say besides the state."""


def _further(prediction: Prediction) -> tuple[float | str | None, ...]:
    frame = prediction.frame
    return (
        _rounded(prediction.door_probability, 4),
        _rounded(prediction.opening_angle_deg, 1),
        prediction.hinge,
        None if frame is None else round(frame.x_m, 3),
        None if frame is None else round(frame.y_m, 3),
        None if frame is None else round(frame.yaw_deg, 1),
        _rounded(prediction.opening_width_m, 3),
        _rounded(prediction.passable_width_m, 3),
    )


def _rounded(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)
