# SPDX-License-Identifier: Apache-2.0
"""Prediction from the outputs of a network for one cloud."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from doorstate.inference.abstention import Abstention
from doorstate.inference.backends.base import CloudOutputs
from doorstate.inference.prediction import DoorFrame, Prediction
from doorstate.types import DECISION_THRESHOLD, STATES, DoorState


def decode(outputs: CloudOutputs, abstain_below: float, num_points: int, milliseconds: float) -> Prediction:
    """Return the likeliest state with the geometry, or none where the network sees no door or is unsure.

    Args:
        outputs: outputs of the network.
        abstain_below: least probability of a state.
        num_points: points that the network evaluated.
        milliseconds: time from the raw cloud to the outputs.
    """
    heads = outputs.heads
    abstention = _abstention(outputs, abstain_below)
    return Prediction(
        state=None if abstention else DoorState.from_index(int(outputs.probabilities.argmax())),
        probabilities={state: float(p) for state, p in zip(STATES, outputs.probabilities, strict=True)},
        num_points=num_points,
        milliseconds=milliseconds,
        abstention=abstention,
        opening_angle_deg=heads.get("opening_angle_deg"),
        door_probability=heads.get("p_door"),
        hinge=_hinge(heads),
        frame=_frame(heads),
        opening_width_m=heads.get("opening_width_m"),
        passable_width_m=heads.get("passable_width_m"),
    )


def _abstention(outputs: CloudOutputs, abstain_below: float) -> Abstention | None:
    p_door = outputs.heads.get("p_door")
    if p_door is not None and p_door < DECISION_THRESHOLD:
        return Abstention("no_door", {"probability": p_door})
    likeliest = int(outputs.probabilities.argmax())
    probability = float(outputs.probabilities[likeliest])
    if probability < abstain_below:
        values: dict[str, float | str] = {
            "state": STATES[likeliest],
            "probability": probability,
            "min_probability": abstain_below,
        }
        return Abstention("unsure", values)
    return None


def _hinge(heads: Mapping[str, float]) -> Literal["left", "right"] | None:
    if "p_hinge_left" not in heads:
        return None
    return "left" if heads["p_hinge_left"] >= DECISION_THRESHOLD else "right"


def _frame(heads: Mapping[str, float]) -> DoorFrame | None:
    if "door_x_m" not in heads:
        return None
    return DoorFrame(heads["door_x_m"], heads["door_y_m"], heads["door_yaw_deg"])
