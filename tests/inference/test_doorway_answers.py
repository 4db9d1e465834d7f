# SPDX-License-Identifier: Apache-2.0
"""Corrections are carried to the sensor frame, and one of the overlapping candidates is the door."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import expit, logit

from doorstate.doorways.candidate_errors import candidate_errors
from doorstate.doorways.doorway import Doorway
from doorstate.inference.door import Door
from doorstate.inference.doorway_answers import Answer, DecidedDoors, decide_doors
from doorstate.networks.door_calibration import DoorCalibration
from doorstate.types import DoorState
from tests.inference.scripted_doorways import CARD, FLOOR_M, MEASURED, doorway, outputs

_ANGLE = st.floats(-179, 179)
_STEP = st.floats(-0.3, 0.3)


def decided(*answers: Answer) -> DecidedDoors:
    return decide_doors(answers, CARD)


@given(
    x_m=st.floats(1, 5),
    y_m=st.floats(-2, 2),
    yaw_deg=_ANGLE,
    along_m=_STEP,
    across_m=_STEP,
    turn_deg=st.floats(-20, 20),
)
def test_corrections_of_the_crop_are_carried_to_the_sensor_frame(
    x_m: float, y_m: float, yaw_deg: float, along_m: float, across_m: float, turn_deg: float
) -> None:
    """The corrected frame holds a point of the true door's frame at the same place as the crop does."""
    candidate = Doorway(x_m, y_m, yaw_deg, 0.9, FLOOR_M)
    (door,) = decided(
        Answer(candidate, outputs(door_x_m=along_m, door_y_m=across_m, door_yaw_deg=turn_deg))
    ).doors
    turn = math.radians(turn_deg)
    # A point half a metre along the true wall and 20 cm before it, in the frame of the crop.
    in_crop = np.array(
        [
            along_m + 0.5 * math.cos(turn) - 0.2 * math.sin(turn),
            across_m + 0.5 * math.sin(turn) + 0.2 * math.cos(turn),
            1.0,
        ],
        np.float32,
    )
    true = Doorway(door.x_m, door.y_m, door.yaw_deg, door.width_m, FLOOR_M)
    np.testing.assert_allclose(
        candidate.to_sensor(in_crop), true.to_sensor(np.array([0.5, 0.2, 1.0], np.float32)), atol=2e-5
    )
    assert -180 <= door.yaw_deg < 180


def test_a_correction_moves_the_door_of_a_wall_straight_ahead() -> None:
    """Along the wall is to the left, towards the robot is back."""
    (door,) = decided(
        Answer(
            doorway(3.0), outputs("open", door_x_m=0.1, door_y_m=0.2, door_yaw_deg=-5.0, opening_width_m=0.8)
        )
    ).doors
    assert (door.x_m, door.y_m, door.yaw_deg) == pytest.approx((2.8, 0.1, 85.0), abs=1e-5)
    assert (door.width_m, door.passable_width_m) == pytest.approx((0.8, 0.8))
    assert (door.state, door.hinge, door.floor_z_m) == (DoorState.OPEN, "left", FLOOR_M)
    assert door.hinge_probability == pytest.approx(0.8)
    assert door.distance_m == pytest.approx(math.hypot(2.8, 0.1))
    assert door.opening_angle_deg == pytest.approx(90.0)


def test_no_passage_is_wider_than_its_opening() -> None:
    (door,) = decided(Answer(doorway(), outputs("open", opening_width_m=0.7, passable_width_m=0.9))).doors
    assert door.passable_width_m == pytest.approx(0.7)


def test_an_impossible_width_is_the_finders() -> None:
    (door,) = decided(Answer(doorway(width_m=1.0), outputs(opening_width_m=0.0))).doors
    assert (door.width_m, door.passable_width_m) == pytest.approx((1.0, 0.1))


def test_of_overlapping_candidates_the_one_that_finder_and_network_hold_likeliest_is_the_door() -> None:
    """The finder often proposes an opening and, half a metre beside it, a wider one that the network likes as well."""
    exact = Answer(doorway(3.0, score=0.9), outputs("closed", 0.9, door_x_m=0.02))
    wide = Answer(replace(doorway(3.0, width_m=1.8, score=0.3), y_m=-0.45), outputs("open", 0.95))
    (door,) = decided(exact, wide).doors
    assert (door.state, door.score) == (DoorState.CLOSED, 0.9)
    assert (door.y_m, door.door_probability) == pytest.approx((0.02, 0.9), abs=1e-5)
    assert decided(wide, exact).doors == (door,)


def test_a_door_overlaps_with_nothing_that_the_finder_alone_holds_likely() -> None:
    answers = [
        Answer(doorway(3.0, score=0.9), outputs("closed", 0.45)),
        Answer(replace(doorway(3.0, score=0.4), y_m=0.3), outputs("open", 0.9)),
    ]
    (door,) = decided(*answers).doors
    assert (door.state, door.y_m) == (DoorState.OPEN, pytest.approx(0.3))


def test_openings_that_share_a_quarter_are_one_door() -> None:
    def count(apart_m: float) -> int:
        other = replace(doorway(3.0), y_m=apart_m)
        return len(decided(Answer(doorway(3.0), outputs()), Answer(other, outputs())).doors)

    assert (count(0.6), count(0.75)) == (1, 2)  # 0.9 m wide


def test_an_improbable_candidate_adds_nothing_to_the_door_that_it_overlaps() -> None:
    answers = [
        Answer(doorway(3.0), outputs("open", 0.9)),
        Answer(replace(doorway(3.0), y_m=0.3), outputs("closed", 0.3)),
    ]
    alone, both = decided(answers[0]), decided(*answers)
    assert both == alone
    assert both.refused == ()


@pytest.mark.parametrize(
    "other",
    [
        replace(doorway(3.0), y_m=1.0),  # the neighbour behind a jamb
        replace(doorway(3.0), x_m=3.5),  # in a recess
        replace(doorway(3.0), yaw_deg=60.0),  # on another wall
    ],
)
def test_doors_beside_behind_and_across_stay_apart(other: Doorway) -> None:
    assert len(decided(Answer(doorway(3.0), outputs()), Answer(other, outputs())).doors) == 2


def test_half_of_a_double_door_is_the_same_door() -> None:
    whole, half = doorway(3.0, width_m=1.8), replace(doorway(3.0), y_m=0.45)
    answers = [
        Answer(whole, outputs(opening_width_m=1.8)),
        Answer(half, outputs(p_door=0.4)),
    ]
    (door,) = decided(*answers).doors
    assert (door.width_m, door.y_m) == pytest.approx((1.8, 0.0), abs=1e-5)


def test_improbable_and_unsure_candidates_give_reasons() -> None:
    found = decide_doors(
        [
            Answer(doorway(3.0), outputs("open", 0.8, p_state=0.5)),
            Answer(doorway(3.0, 50.0), outputs("open", 0.2)),
        ],
        CARD.model_copy(update={"abstain_below": 0.6}),
    )
    (unsure,), (no_door,) = found.doors, found.refused
    assert unsure.abstention is not None
    assert (unsure.state, unsure.abstention.code, unsure.door_probability) == (
        None,
        "unsure",
        pytest.approx(0.8),
    )
    assert no_door.abstention is not None
    assert no_door.abstention.code == "no_door"
    assert no_door.frame.x_m == pytest.approx(3.0 * math.cos(math.radians(50)), abs=1e-5)
    assert found.known is None


def test_a_known_door_is_the_likeliest_at_its_place() -> None:
    answers = [
        Answer(doorway(3.0), outputs("open", 0.3), is_asked=True),
        Answer(doorway(3.0, 30.0), outputs("closed", 0.4), is_asked=True),
        Answer(doorway(3.0, -40.0), outputs("closed", 0.2)),
    ]
    found = decided(*answers)
    assert [door.state for door in found.doors] == [DoorState.CLOSED]
    assert found.known is found.doors[0]
    assert len(found.refused) == 2
    assert found.known.door_probability == pytest.approx(0.4)


def test_without_the_head_for_a_door_the_finders_best_is_the_door() -> None:
    headless = CARD.model_copy(update={"heads": ("angle", "hinge", "frame", "widths")})
    heads = dict(outputs().heads)
    del heads["p_door"]
    plain = outputs()._replace(heads=heads)
    answers = [Answer(doorway(3.0, 30.0, score=0.4), plain), Answer(doorway(3.0, score=0.6), plain)]
    found = decide_doors(answers, headless)
    assert [door.score for door in found.doors] == [0.6]
    assert found.doors[0].door_probability is None


def test_without_heads_for_it_place_and_width_are_the_finders() -> None:
    plain = outputs()._replace(heads={"p_door": 0.9})
    (door,) = decide_doors([Answer(doorway(3.0, 10.0, 1.1), plain)], CARD).doors
    assert (door.distance_m, door.width_m) == pytest.approx((3.0, 1.1))
    assert (door.opening_angle_deg, door.hinge, door.passable_width_m) == (None, None, None)
    errors = candidate_errors(door.score or 0.0)
    assert door.position_error_m == pytest.approx(math.hypot(errors.along_m, errors.across_m))
    assert door.yaw_error_deg == pytest.approx(errors.yaw_deg)
    assert door.angle_error_deg is None


def test_heads_that_an_exported_network_withholds_are_missing() -> None:
    withheld = outputs("open", 0.9)._replace(heads={"p_door": 0.9})
    (door,) = decided(Answer(doorway(3.0), withheld)).doors
    assert (door.state, door.opening_angle_deg) == (DoorState.OPEN, None)


def test_a_correction_counts_by_the_errors_of_finder_and_network() -> None:
    def door(score: float) -> Door:
        answer = Answer(doorway(3.0, score=score), outputs("semi_open", door_x_m=0.06, opening_width_m=1.0))
        (found,) = decide_doors([answer], MEASURED).doors
        return found

    sure, unsure = door(0.95), door(0.25)
    assert sure.y_m == pytest.approx(0.06 * 0.011**2 / (0.011**2 + 0.04**2), abs=1e-6)
    assert unsure.y_m == pytest.approx(0.06 * 0.238**2 / (0.238**2 + 0.04**2), abs=1e-6)
    assert 0.9 < sure.width_m < 0.92 < 0.98 < unsure.width_m < 1.0
    assert (sure.position_error_m or 1) < 0.012 < 0.03 < (unsure.position_error_m or 0) < 0.05
    assert (sure.angle_error_deg, unsure.angle_error_deg) == (6.0, 6.0)


def test_the_probability_of_a_door_is_that_of_network_and_finder() -> None:
    calibration = DoorCalibration(door=0.5, score=1.0, offset=-0.2)
    card = CARD.model_copy(update={"door_calibration": calibration})
    sure, unsure = doorway(score=0.9), doorway(bearing_deg=40, score=0.1)
    result = decide_doors([Answer(place, outputs(p_door=0.9)) for place in (sure, unsure)], card)
    (door,), (refused,) = result.doors, result.refused
    assert door.door_probability == pytest.approx(expit(0.5 * logit(0.9) + logit(0.9) - 0.2))
    assert refused.door_probability == pytest.approx(expit(0.5 * logit(0.9) + logit(0.1) - 0.2))
    assert refused.abstention is not None
    assert refused.abstention.code == "no_door"


def test_a_known_door_is_one_whatever_the_finder_holds_of_it() -> None:
    card = CARD.model_copy(update={"door_calibration": DoorCalibration(door=0.5, score=1.0, offset=-5.0)})
    (door,) = decide_doors([Answer(doorway(), outputs(), is_asked=True)], card).doors
    assert door.state == DoorState.CLOSED
