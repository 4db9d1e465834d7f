# SPDX-License-Identifier: Apache-2.0
"""Prediction from the outputs of a network for one cloud."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from doorstate.inference.abstention import Abstention
from doorstate.inference.backends.base import CloudOutputs
from doorstate.inference.door import Door, DoorFrame
from doorstate.inference.prediction import Prediction
from doorstate.types import DECISION_THRESHOLD, STATES, DoorState


def decode(
    outputs: CloudOutputs,
    abstain_below: float,
    num_points: int,
    milliseconds: float,
    *,
    door_known: bool = False,
) -> Prediction:
    """Return the likeliest state with the geometry, or neither where the network sees no door or is unsure.

    Args:
        outputs: outputs of the network for a whole cloud.
        abstain_below: least probability of a state.
        num_points: points that the network evaluated.
        milliseconds: time from the raw cloud to the outputs.
        door_known: a door is known to be in view.
    """
    heads = outputs.heads
    abstention = abstention_of(outputs, abstain_below, door_known=door_known)
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
    if abstention:
        return prediction
    prediction = replace(prediction, **leaf_fields(heads), **_frame_fields(heads))
    return replace(prediction, doors=_doors(prediction))


def abstention_of(
    outputs: CloudOutputs,
    abstain_below: float,
    *,
    door_known: bool = False,
    min_door_probability: float = DECISION_THRESHOLD,
) -> Abstention | None:
    """Return the reason why the outputs of a network give no state; None where they give one.

    Args:
        outputs: outputs of the network.
        abstain_below: least probability of a state.
        door_known: a door is known to be there, so that its probability is not asked.
        min_door_probability: least probability of a door.
    """
    if not outputs.are_valid():
        return Abstention("invalid_outputs")
    p_door = outputs.heads.get("p_door")
    if p_door is not None and p_door < min_door_probability and not door_known:
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


def leaf_fields(heads: Mapping[str, float]) -> dict[str, Any]:
    """Return angle, passage and hinge, which a door and the prediction of a single one have alike."""
    fields: dict[str, Any] = {name: heads.get(name) for name in ("opening_angle_deg", "passable_width_m")}
    if "p_hinge_left" in heads:
        p_left = heads["p_hinge_left"]
        is_left = p_left >= DECISION_THRESHOLD
        fields |= {
            "hinge": "left" if is_left else "right",
            "hinge_probability": p_left if is_left else 1 - p_left,
        }
    return fields


def _frame_fields(heads: Mapping[str, float]) -> dict[str, Any]:
    fields: dict[str, Any] = {"opening_width_m": heads.get("opening_width_m")}
    if "door_x_m" in heads:
        fields["frame"] = DoorFrame(heads["door_x_m"], heads["door_y_m"], heads["door_yaw_deg"])
    return fields


def _doors(prediction: Prediction) -> tuple[Door, ...]:
    """Return the door of a whole cloud, where its frame is known."""
    if prediction.frame is None or not prediction.opening_width_m:
        return ()
    door = Door(
        *prediction.frame,
        prediction.opening_width_m,
        prediction.state,
        raw_probabilities=prediction.raw_probabilities,
        door_probability=prediction.door_probability,
        opening_angle_deg=prediction.opening_angle_deg,
        hinge=prediction.hinge,
        hinge_probability=prediction.hinge_probability,
        passable_width_m=prediction.passable_width_m,
    )
    return (door,)
