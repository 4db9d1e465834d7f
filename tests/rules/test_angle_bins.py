# SPDX-License-Identifier: Apache-2.0
"""Angle bins: bins, angles of known scenes, least data, and walls without a leaf."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from doorstate.rules.angle_bins import AngleBinsParameters, AngleBinsRule
from doorstate.types import DoorState
from tests.rules.hand_made import door, edge_on_deg, see

RULE = AngleBinsRule()


VIEWS = [
    (angle, wall)
    for angle in (20, 35, 50, 55, 65, 75, 90)
    for wall in (-40, -20, 0, 20, 40)
    if edge_on_deg(angle, wall) > 15
]


@pytest.mark.parametrize(("angle", "wall"), VIEWS)
def test_the_angle_is_within_two_degrees_and_binned_at_sixty(angle: int, wall: int) -> None:
    result = RULE(see(door(angle, wall_deg=wall)))
    assert result.opening_angle_deg == pytest.approx(angle, abs=2)
    assert result.state == (DoorState.OPEN if angle > 60 else DoorState.SEMI_OPEN)


@settings(max_examples=15, derandomize=True)
@given(angle=st.floats(18, 57), wall=st.floats(-30, 30), hinge=st.sampled_from(["left", "right"]))
def test_the_side_of_the_hinge_does_not_matter(angle: float, wall: float, hinge: str) -> None:
    assume(edge_on_deg(angle, wall, hinge=hinge) > 15)
    result = RULE(see(door(angle, wall_deg=wall, hinge=hinge)))
    assert result.state == DoorState.SEMI_OPEN
    assert result.opening_angle_deg == pytest.approx(angle, abs=2)


def test_beyond_perpendicular_the_angle_folds_back() -> None:
    result = RULE(see(door(110)))
    assert result.state == DoorState.OPEN
    assert result.opening_angle_deg == pytest.approx(70, abs=2)


def test_the_bins_are_parameters() -> None:
    seen = see(door(40))
    assert AngleBinsRule(AngleBinsParameters(closed_below_deg=45))(seen).state == DoorState.CLOSED
    assert AngleBinsRule(AngleBinsParameters(open_above_deg=35))(seen).state == DoorState.OPEN


@pytest.mark.parametrize("wall", [-50, 0, 50])
def test_an_unbroken_wall_is_closed(wall: int) -> None:
    result = RULE(see(door(0, wall_deg=wall)))
    assert result.state == DoorState.CLOSED
    assert result.opening_angle_deg == pytest.approx(0, abs=2)


@pytest.mark.parametrize("wall", [-35, 0, 35])
def test_a_void_that_is_seen_through_is_open(wall: int) -> None:
    *frame, _ = door(0, wall_deg=wall)
    result = RULE(see(frame))
    assert result.state == DoorState.OPEN
    assert result.opening_width_m == pytest.approx(0.9, abs=0.15)
    assert [shape.name for shape in result.detections] == ["wall", "opening"]


def test_a_void_without_readings_is_not_open() -> None:
    *frame, _ = door(0)
    seen = see(frame)
    blind = np.where((seen[..., :1] > 2.55) & (np.abs(seen[..., 1:2]) < 0.8), np.nan, seen)
    result = RULE(blind.astype(np.float32))
    assert result.state is None
    assert result.reason


def test_too_few_measured_pixels_give_no_state_even_for_a_clear_door() -> None:
    seen = see(door(40))
    assert RULE(seen).state == DoorState.SEMI_OPEN
    lost = np.random.default_rng(2).random(seen.shape[:2]) < 0.8
    result = RULE(np.where(lost[..., None], np.nan, seen).astype(np.float32))
    assert result.state is None
    assert result.reason


@pytest.mark.parametrize(
    "cloud",
    [
        np.empty((0, 3), np.float32),
        np.full((48, 64, 3), np.nan, np.float32),
        np.full((900, 3), np.nan, np.float32),
        see([], farthest_m=20.0),
        see([((2.0, 0.4), (2.0, -0.4), -1.0, 1.0)]),
        see([((2.0, 0.05), (2.0, -0.05), -1.0, 1.0)], farthest_m=20.0),
    ],
    ids=["empty", "all NaN", "flat NaN", "floor", "no wall", "tiny leaf"],
)
def test_scenes_without_a_door_have_a_reason(cloud: np.ndarray) -> None:
    result = RULE(cloud)
    assert result.state is None
    assert result.reason
