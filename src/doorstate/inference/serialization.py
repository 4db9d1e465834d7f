# SPDX-License-Identifier: Apache-2.0
"""How an answer is worded for other programs: by the command line and by the service."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from doorstate.errors import TooFewPointsError

if TYPE_CHECKING:
    from doorstate.inference.predictor import Prediction


def described(prediction: Prediction) -> dict[str, Any]:
    """A prediction as JSON takes it."""
    return {
        "state": None if prediction.state is None else prediction.state.label,
        "probabilities": {state: round(p, 6) for state, p in prediction.probabilities.items()},
        "points": prediction.points,
        "milliseconds": round(prediction.milliseconds, 3),
        **({"reason": prediction.reason} if prediction.state is None else {}),
        **{name: told for name, tell in FURTHER.items() if (told := tell(prediction)) is not None},
    }


def described_file(prediction: Prediction) -> dict[str, Any]:
    """A prediction of a file as JSON takes it; one without points is broken, where a frame of a stream is unknown.

    Raises:
        TooFewPointsError: there was nothing to look at.
    """
    if prediction.points == 0:
        raise TooFewPointsError(prediction.reason)
    return described(prediction)


def _rounded(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)


FURTHER: dict[str, Callable[[Prediction], float | str | None]] = {
    "door_probability": lambda said: _rounded(said.door_probability, 4),
    "opening_angle_deg": lambda said: _rounded(said.opening_angle_deg, 1),
    "hinge": lambda said: said.hinge,
    "door_x_m": lambda said: said.frame and round(said.frame.x_m, 3),
    "door_y_m": lambda said: said.frame and round(said.frame.y_m, 3),
    "door_yaw_deg": lambda said: said.frame and round(said.frame.yaw_deg, 1),
    "opening_width_m": lambda said: _rounded(said.opening_width_m, 3),
    "passable_width_m": lambda said: _rounded(said.passable_width_m, 3),
}
"""What some methods say besides the state."""
