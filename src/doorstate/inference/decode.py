# SPDX-License-Identifier: Apache-2.0
"""Prediction from the outputs of a network for one cloud."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from doorstate.inference.abstention import Abstention
from doorstate.inference.backends.base import CloudOutputs
from doorstate.inference.prediction import DoorFrame, Prediction
from doorstate.types import DECISION_THRESHOLD, STATES, DoorState


def decode(outputs: CloudOutputs, abstain_below: float, num_points: int, milliseconds: float) -> Prediction:
    """Return the likeliest state with the geometry, or neither where the network sees no door or is unsure.

    Args:
        outputs: outputs of the network.
        abstain_below: least probability of a state.
        num_points: points that the network evaluated.
        milliseconds: time from the raw cloud to the outputs.
    """
    heads = outputs.heads
    abstention = abstention_of(outputs, abstain_below)
    if abstention is not None and abstention.code == "invalid_outputs":
        return Prediction.abstain(abstention, num_points, milliseconds)
    prediction = Prediction(
        state=None if abstention else DoorState.from_index(int(outputs.probabilities.argmax())),
        num_points=num_points,
        milliseconds=milliseconds,
        abstention=abstention,
        raw_probabilities=dict(zip(STATES, outputs.probabilities.tolist(), strict=True)),
        door_probability=heads.get("p_door"),
    )
    return prediction if abstention else replace(prediction, **_geometry(heads))


def abstention_of(outputs: CloudOutputs, abstain_below: float) -> Abstention | None:
    """Return the reason why the outputs of a network give no state; None where they give one."""
    if not outputs.are_valid():
        return Abstention("invalid_outputs")
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


def _geometry(heads: Mapping[str, float]) -> dict[str, Any]:
    """Return the fields of a prediction that describe the door."""
    fields: dict[str, Any] = {
        name: heads.get(name) for name in ("opening_angle_deg", "opening_width_m", "passable_width_m")
    }
    if "p_hinge_left" in heads:
        p_left = heads["p_hinge_left"]
        is_left = p_left >= DECISION_THRESHOLD
        fields |= {
            "hinge": "left" if is_left else "right",
            "hinge_probability": p_left if is_left else 1 - p_left,
        }
    if "door_x_m" in heads:
        fields["frame"] = DoorFrame(heads["door_x_m"], heads["door_y_m"], heads["door_yaw_deg"])
    return fields
