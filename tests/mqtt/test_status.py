# SPDX-License-Identifier: Apache-2.0
"""Statuses of doors from predictions and from sightings of doors with names."""

from __future__ import annotations

from doorstate.doors.sighting import Sighting
from doorstate.inference.door import Door
from doorstate.inference.state_filter import FilteredState
from doorstate.mqtt.status import FRONT_DOOR, status_of_front_door, status_of_sighting
from doorstate.types import DoorState
from tests.inference.streams import OPEN, UNKNOWN, predict

IS_OPEN = FilteredState(DoorState.OPEN, {"closed": 0.02, "semi_open": 0.03, "open": 0.95}, 100.0)
NOTHING = FilteredState(None, {"closed": 0.4, "semi_open": 0.3, "open": 0.3}, 100.0)


def test_the_door_in_front_has_the_state_of_the_filter() -> None:
    status = status_of_front_door(predict(OPEN, 0.9), IS_OPEN)
    assert (status.door, status.state, status.details["probability"]) == (FRONT_DOOR, OPEN, 0.95)
    assert "probabilities" not in status.details
    status = status_of_front_door(UNKNOWN, NOTHING, "back")
    assert (status.door, status.state, status.details["reason"]) == ("back", None, UNKNOWN.reason)


def test_a_named_door_has_a_state_only_while_it_is_seen() -> None:
    door = Door(2.0, 0.0, 90.0, 0.9, OPEN, opening_angle_deg=88.0)
    status = status_of_sighting(Sighting("front", door, is_front=True, filtered=IS_OPEN))
    assert (status.door, status.state, status.details["opening_angle_deg"]) == ("front", OPEN, 88.0)
    hidden = Sighting("front", code="out_of_view", last_state=DoorState.OPEN, last_seen_s=90.0)
    status = status_of_sighting(hidden)
    assert status.state is None
    assert status.details["reason"] == hidden.reason()
