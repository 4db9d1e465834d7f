# SPDX-License-Identifier: Apache-2.0
"""State of one door now, as it is handed to a publisher."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from doorstate.doors.sighting import Sighting
from doorstate.inference.prediction import Prediction
from doorstate.inference.serialization import door_to_dict, prediction_to_dict
from doorstate.inference.state_filter import FilteredState
from doorstate.types import DoorState

FRONT_DOOR = "door"  # name of the door most in front, where doors have no names
_NOT_SENT = ("state", "probabilities", "raw_probabilities", "doors", "points", "milliseconds", "tilt")


class DoorStatus(NamedTuple):
    """State of a door after the newest cloud."""

    door: str  # its name, one level of a topic
    state: DoorState | None  # None: not seen now, or unknown
    details: Mapping[str, Any] = MappingProxyType({})  # values for JSON, such as the reason


def status_of_front_door(
    prediction: Prediction, filtered: FilteredState, name: str = FRONT_DOOR
) -> DoorStatus:
    """Return the status of the door most in front: the filter's state, with what the newest cloud says of it.

    Args:
        prediction: prediction for the newest cloud, as in `DoorReport`.
        filtered: state after it, as in `DoorReport`.
        name: name of the door.
    """
    details = prediction_to_dict(prediction)
    if prediction.doors and prediction.state is not None:
        details |= door_to_dict(prediction.doors[0])
    details = {key: value for key, value in details.items() if key not in _NOT_SENT}
    if filtered.state is not None:
        details["probability"] = round(filtered.probabilities[filtered.state], 4)
    return DoorStatus(name, filtered.state, details)


def status_of_sighting(sighting: Sighting) -> DoorStatus:
    """Return the status of a door of a list: its state by the filter while it is seen, else None with the reason."""
    filtered = sighting.filtered
    details = {key: value for key, value in sighting.to_dict().items() if key not in _NOT_SENT}
    if filtered is not None and filtered.state is not None:
        details["probability"] = round(filtered.probabilities[filtered.state], 4)
    return DoorStatus(sighting.id, None if filtered is None else filtered.state, details)
