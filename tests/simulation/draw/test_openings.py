# SPDX-License-Identifier: Apache-2.0
"""States of openings."""

from __future__ import annotations

import pytest

from doorstate.simulation.draw.openings import ANGLES_DEG, SHARES, state_of
from doorstate.simulation.scene import Door, Opening
from doorstate.types import DoorState


@pytest.mark.parametrize(
    ("angle", "state", "ambiguous"),
    [
        (0.0, DoorState.CLOSED, False),
        (3.0, DoorState.CLOSED, False),
        (8.9, DoorState.CLOSED, True),
        (9.1, DoorState.SEMI_OPEN, True),
        (15.0, DoorState.SEMI_OPEN, False),
        (69.9, DoorState.SEMI_OPEN, True),
        (70.1, DoorState.OPEN, True),
        (75.0, DoorState.OPEN, False),
        (160.0, DoorState.OPEN, False),
    ],
)
def test_states_by_angle(angle: float, state: DoorState, ambiguous: bool) -> None:
    assert state_of(Door(), Opening(angle_deg=angle)) == (state, ambiguous)


def test_states_of_a_sliding_door_by_its_share() -> None:
    door = Door(kind="sliding")
    results = [state_of(door, Opening(share=share)) for share in (0.0, 0.1, 0.13, 0.3, 0.7, 0.75, 0.9)]
    closed, semi, opened = DoorState
    assert [state for state, _ in results] == [closed, closed, semi, semi, semi, opened, opened]
    assert [ambiguous for _, ambiguous in results] == [False, True, True, False, True, True, False]
    assert ANGLES_DEG.keys() == SHARES.keys() == set(DoorState)
