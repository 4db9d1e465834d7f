# SPDX-License-Identifier: Apache-2.0
"""Geometry and order of doors, and what a refused one keeps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from doorstate.inference.abstention import Abstention
from doorstate.inference.door import Door
from doorstate.inference.prediction import Prediction
from doorstate.types import DoorState


def at(distance_m: float, bearing_deg: float, state: DoorState | None = DoorState.OPEN) -> Door:
    bearing = math.radians(bearing_deg)
    x_m, y_m = distance_m * math.cos(bearing), distance_m * math.sin(bearing)
    return Door(x_m, y_m, bearing_deg + 90, 0.9, state)


@given(distance_m=st.floats(0.3, 8), bearing_deg=st.floats(-60, 60), width_m=st.floats(0.5, 2.4))
def test_opening_is_on_the_wall_and_its_left_end_on_the_cameras_left(
    distance_m: float, bearing_deg: float, width_m: float
) -> None:
    door = at(distance_m, bearing_deg)
    door = Door(door.x_m, door.y_m, door.yaw_deg, width_m, None)
    left, right = np.array(door.opening.left_m), np.array(door.opening.right_m)
    np.testing.assert_allclose((left + right) / 2, [door.x_m, door.y_m], atol=1e-9)
    assert np.hypot(*(left - right)) == pytest.approx(width_m)
    # Turned to the bearing of the door, left is +y.
    assert -math.sin(math.radians(bearing_deg)) * (left - right)[0] + math.cos(math.radians(bearing_deg)) * (
        left - right
    )[1] == pytest.approx(width_m)
    assert door.distance_m == pytest.approx(distance_m)
    assert door.bearing_deg == pytest.approx(bearing_deg, abs=1e-6)


def test_the_door_most_in_front_is_near_and_ahead() -> None:
    assert at(3.0, 0.0).remoteness_m == pytest.approx(3.0)
    assert at(3.0, 30.0).remoteness_m == pytest.approx(6.0)
    assert at(1.2, 60.0).remoteness_m == at(1.2, -60.0).remoteness_m == pytest.approx(6.0)
    near_aside, far_ahead, beside = at(1.5, 20.0), at(4.5, 5.0), at(1.2, -60.0)
    ordered = sorted([beside, far_ahead, near_aside], key=lambda door: door.remoteness_m)
    assert ordered == [near_aside, far_ahead, beside]


def test_a_refused_door_keeps_its_place_and_loses_its_state() -> None:
    door = Door(
        3.0,
        0.5,
        90.0,
        0.9,
        DoorState.OPEN,
        raw_probabilities={"closed": 0.1, "semi_open": 0.1, "open": 0.8},
        opening_angle_deg=88.0,
        angle_error_deg=5.0,
        hinge="left",
        hinge_probability=0.9,
        passable_width_m=0.8,
        leaf_seen=True,
        position_error_m=0.05,
    )
    assert (door.probability, door.label, door.reason) == (0.8, "open", "")
    refused = door.refuse(Abstention("no_door", {"probability": 0.2}))
    assert (refused.frame, refused.width_m, refused.position_error_m) == (door.frame, 0.9, 0.05)
    assert refused.raw_probabilities == door.raw_probabilities
    lost = (
        "state",
        "probabilities",
        "opening_angle_deg",
        "angle_error_deg",
        "hinge",
        "passable_width_m",
        "leaf_seen",
    )
    assert {getattr(refused, name) for name in lost} == {None}
    assert (refused.label, bool(refused.reason)) == ("abstained", True)


def test_a_prediction_is_about_its_first_door() -> None:
    first, second = at(2.0, 0.0), at(2.0, 40.0, DoorState.CLOSED)
    prediction = Prediction.from_doors([first, second], [], 2048, 30.0)
    assert prediction.state is DoorState.OPEN
    assert prediction.doors == (first, second)
    assert (prediction.frame, prediction.opening_width_m) == (first.frame, 0.9)
    assert prediction.opening == first.opening
    unsure = first.refuse(Abstention("unsure", {"state": "open", "probability": 0.5, "min_probability": 0.6}))
    refused = Prediction.from_doors([unsure, second], [], 2048, 30.0)
    assert (refused.state, refused.frame, refused.probabilities) == (None, None, None)
    assert refused.abstention == unsure.abstention
    assert [door.label for door in refused.doors] == ["abstained", "closed"]


def test_without_doors_the_reason_is_that_of_the_likeliest_candidate() -> None:
    none = Prediction.from_doors([], [], 300, 30.0)
    assert none.abstention is not None
    assert (none.abstention.code, none.door_probability) == ("no_doorway", None)
    candidates = [
        Door(3, 0, 90, 0.9, None, Abstention("no_door", {"probability": p}), door_probability=p)
        for p in (0.1, 0.4, 0.2)
    ]
    prediction = Prediction.from_doors([], candidates, 300, 30.0)
    assert prediction.abstention == Abstention("no_door", {"probability": 0.4})
    assert prediction.door_probability == 0.4
    assert prediction.refused == tuple(candidates)


@pytest.mark.parametrize(("leaf_seen", "confirmed"), [(True, True), (None, True), (False, False)])
def test_an_open_door_without_a_leaf_confirms_nothing_unless_told_otherwise(
    leaf_seen: bool | None, confirmed: bool
) -> None:
    door = Door(3, 0, 90, 0.9, DoorState.OPEN, leaf_seen=leaf_seen)
    prediction = Prediction.from_doors([door], [], 1024, 30.0)
    assert prediction.leaf_seen == leaf_seen
    assert prediction.confirms(DoorState.OPEN) == confirmed
    assert prediction.confirms(DoorState.OPEN, require_leaf=False)
    assert not prediction.confirms(DoorState.CLOSED)
