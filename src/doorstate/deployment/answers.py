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
        **(
            {}
            if prediction.opening_angle_deg is None
            else {"opening_angle_deg": round(prediction.opening_angle_deg, 1)}
        ),
    }
