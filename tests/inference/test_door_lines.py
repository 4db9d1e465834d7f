# SPDX-License-Identifier: Apache-2.0
"""Lines of predicted doors."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

from doorstate.inference.abstention import Abstention
from doorstate.inference.door import Door
from doorstate.inference.door_lines import DOOR_HEIGHT_M, Line, door_lines
from doorstate.inference.prediction import Prediction
from doorstate.types import DoorState

FLOOR_M = -1.0


def door(
    hinge: Literal["left", "right"] | None = "left", angle_deg: float | None = 90.0, y_m: float = 0.0
) -> Door:
    """Return a door in a wall straight ahead, three metres away."""
    return Door(3.0, y_m, 90.0, 0.8, DoorState.OPEN, hinge=hinge, opening_angle_deg=angle_deg)


def lines_of(*doors: Door, refused: tuple[Door, ...] = (), draws_refused: bool = False) -> list[Line]:
    prediction = Prediction.from_doors(doors, refused, 1024, 20.0)
    return door_lines(prediction, FLOOR_M, refused=draws_refused)


@pytest.mark.parametrize(("hinge", "y_m"), [("left", 0.4), ("right", -0.4)])
def test_leaf_hangs_on_the_hinge_and_opens_towards_the_robot(
    hinge: Literal["left", "right"], y_m: float
) -> None:
    lines = {line.name: line for line in lines_of(door(hinge))}
    assert list(lines) == ["door frame", "leaf", "angle", "swing", "hinge"]
    frame = lines["door frame"].points_m
    assert set(frame[:, 1].round(9)) == {0.4, -0.4}
    assert set(frame[:, 2]) == {FLOOR_M, FLOOR_M + DOOR_HEIGHT_M}
    np.testing.assert_allclose(lines["hinge"].points_m[0], [3.0, y_m, FLOOR_M], atol=1e-12)
    leaf = lines["leaf"].points_m
    np.testing.assert_allclose(leaf[[0, 3]], [[3.0, y_m, FLOOR_M], [2.2, y_m, FLOOR_M]], atol=1e-12)
    assert lines["angle"].label == "90°"
    np.testing.assert_allclose(lines["swing"].points_m[[0, -1]], [[3.0, -y_m, FLOOR_M], [2.2, y_m, FLOOR_M]])


def test_the_swing_of_a_shut_leaf_is_the_way_it_takes_to_be_open() -> None:
    lines = {line.name: line.points_m for line in lines_of(door(angle_deg=0.0))}
    assert {tuple(corner) for corner in lines["leaf"].round(9)} == {
        tuple(corner) for corner in lines["door frame"].round(9)
    }
    np.testing.assert_allclose(lines["swing"][-1], [2.2, 0.4, FLOOR_M], atol=1e-12)
    np.testing.assert_allclose(np.hypot(*(lines["swing"][:, :2] - [3.0, 0.4]).T), 0.8)


def test_lines_without_their_heads_are_left_out() -> None:
    assert lines_of() == []
    assert [line.name for line in lines_of(door(hinge=None))] == ["door frame"]
    assert [line.name for line in lines_of(door(angle_deg=None))] == ["door frame", "hinge"]


def test_several_doors_are_numbered_and_refused_candidates_drawn_on_request() -> None:
    shut = door(y_m=1.5).refuse(
        Abstention("unsure", {"state": "open", "probability": 0.5, "min_probability": 0.6})
    )
    no_door = Door(
        4.0, -1.0, 90.0, 0.9, None, Abstention("no_door", {"probability": 0.12}), door_probability=0.12
    )
    frames = [line.label for line in lines_of(door(), shut, refused=(no_door,)) if line.name == "door frame"]
    assert frames == ["1: open", "2: abstained"]
    assert lines_of(door())[0].label == ""
    drawn = lines_of(refused=(no_door,), draws_refused=True)
    assert [(line.name, line.label) for line in drawn] == [("refused", "no door (0.12)")]
    np.testing.assert_allclose(drawn[0].points_m[:, 0], 4.0)


def test_a_door_stands_on_its_own_floor() -> None:
    low = Door(3.0, 0.0, 90.0, 0.8, DoorState.OPEN, floor_z_m=-1.4)
    assert lines_of(low)[0].points_m[:, 2].min() == -1.4
