# SPDX-License-Identifier: Apache-2.0
"""Views that are easily taken for something else: answers of the default weights."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from doorstate import Predictor
from doorstate.doorways.doorway import gap
from doorstate.types import DoorState
from tests.doorways import scenes
from tests.doorways.scenes import HandMade

Make = Callable[[], HandMade]


@pytest.fixture(scope="module")
def predictor() -> Predictor:
    return Predictor.load()


@pytest.mark.parametrize(
    "make",
    [
        scenes.closed_door_beside_free_corridor,
        scenes.leaf_square_in_the_room,
        scenes.doorway_at_the_edge_of_a_rolled_view,
        scenes.lower_leaf_from_near_the_floor,
        scenes.window_beside_a_closed_door,
        scenes.open_doorway_without_lintel,
        scenes.open_leaf_at_the_near_jamb,
    ],
)
def test_the_door_is_found_in_its_place_and_state(make: Make, predictor: Predictor) -> None:
    made = make()
    (true,) = made.doors
    prediction = predictor(made.points, is_level=True)
    door = min(prediction.doors, key=lambda door: gap(true, door)[0])
    assert gap(true, door)[0] < 0.1
    assert door.state == true.state


@pytest.mark.parametrize("make", [scenes.table_football, scenes.board_standing_free, scenes.counter])
def test_furniture_is_no_door(make: Make, predictor: Predictor) -> None:
    assert [door for door in predictor(make().points, is_level=True).doors if door.state is not None] == []


@pytest.mark.parametrize(
    "make",
    [
        scenes.dark_leaf,
        scenes.dark_leaf_seen_without_floor,
        scenes.glazed_dark_leaf,
        scenes.glass_leaf_seen_through,
        scenes.board_before_the_lens,
    ],
)
def test_closed_doors_are_never_open(make: Make, predictor: Predictor) -> None:
    doors = predictor(make().points, is_level=True).doors
    assert [door for door in doors if door.state == DoorState.OPEN] == []
