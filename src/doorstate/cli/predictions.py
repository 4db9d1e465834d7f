# SPDX-License-Identifier: Apache-2.0
"""How `predict` words an answer, of a file or of a message."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from doorstate.deployment.predictor import Prediction


def described(prediction: Prediction) -> dict[str, Any]:
    """A prediction as `--json` prints it."""
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


def table_cells(answer: dict[str, Any]) -> list[str]:
    """A described prediction as cells: state, probabilities, points, milliseconds."""
    said = answer["state"] or f"none: {answer['reason']}"
    odds = [f"{probability:.3f}" for probability in answer["probabilities"].values()]
    return [said, *odds, str(answer["points"]), f"{answer['milliseconds']:.0f}"]
