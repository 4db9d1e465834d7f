# SPDX-License-Identifier: Apache-2.0
"""Leaf and wall planes: states and angles of scenes with known planes, and abstention without a door."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from doorstate.rules.plane_state import PlaneStateRule
from doorstate.types import DoorState
from tests.rules.hand_made import door, edge_on_deg, see

RULE = PlaneStateRule()


VIEWS = [
    (angle, wall)
    for angle in (12, 20, 35, 50, 65, 75, 90, 105, 120, 140)
    for wall in (-40, -20, 0, 20, 40)
    if edge_on_deg(angle, wall) > 12
]


@pytest.mark.parametrize(("angle", "wall"), VIEWS)
def test_the_angle_is_within_two_degrees_on_both_sides_of_perpendicular(angle: int, wall: int) -> None:
    result = RULE(see(door(angle, wall_deg=wall)))
    assert result.opening_angle_deg == pytest.approx(angle, abs=2)
    assert result.state == (DoorState.OPEN if angle > 70 else DoorState.SEMI_OPEN)
    assert {shape.name for shape in result.detections} == {"wall", "leaf"}


@settings(max_examples=15, derandomize=True)
@given(
    angle=st.floats(15, 60),
    wall=st.floats(-30, 30),
    distance=st.floats(2.2, 3.2),
    hinge=st.sampled_from(["left", "right"]),
    away=st.booleans(),
)
def test_hinge_side_and_swing_do_not_matter(
    angle: float, wall: float, distance: float, hinge: str, away: bool
) -> None:
    assume(away or edge_on_deg(angle, wall, distance, hinge) > 12)
    result = RULE(see(door(angle, wall_deg=wall, distance_m=distance, hinge=hinge, away=away)))
    assert result.state == DoorState.SEMI_OPEN
    assert result.opening_angle_deg == pytest.approx(angle, abs=2)


@pytest.mark.parametrize(("angle", "wall"), [(35, -40), (50, -40), (120, 40)])
def test_a_leaf_seen_from_its_edge_is_no_free_way(angle: int, wall: int) -> None:
    *frame, leaf = door(angle, wall_deg=wall)
    thick = [leaf, (leaf[1], (leaf[1][0] + 0.02, leaf[1][1] + 0.04), *leaf[2:])]
    result = RULE(see([*frame, *thick]))
    assert result.state in (None, DoorState.OPEN if angle > 70 else DoorState.SEMI_OPEN)


@pytest.mark.parametrize("wall", [-50, 0, 50])
def test_a_leaf_flush_with_its_wall_is_closed(wall: int) -> None:
    result = RULE(see(door(0, wall_deg=wall)))
    assert result.state == DoorState.CLOSED
    assert result.opening_angle_deg == pytest.approx(0, abs=2)


def test_a_leaf_behind_the_face_of_its_wall_is_closed() -> None:
    *wall, _ = door(0)
    result = RULE(see([*wall, ((2.6, 0.45), (2.6, -0.45), -0.99, 1.09)]))
    assert result.state == DoorState.CLOSED
    assert result.opening_angle_deg == pytest.approx(0, abs=2)
    assert "leaf" in {shape.name for shape in result.detections}


def test_the_width_of_the_opening_is_that_between_hinge_and_latch() -> None:
    result = RULE(see(door(90, wall_deg=20)))
    assert result.opening_width_m == pytest.approx(0.9, abs=0.05)


def test_a_void_with_a_floor_behind_is_open_and_one_without_readings_is_not() -> None:
    *wall, _ = door(0)
    seen = see(wall)
    result = RULE(seen)
    assert result.state == DoorState.OPEN
    assert result.opening_angle_deg is None
    assert result.opening_width_m == pytest.approx(0.9, abs=0.15)
    blind = np.where((seen[..., :1] > 2.55) & (np.abs(seen[..., 1:2]) < 0.8), np.nan, seen)
    unseen = RULE(blind.astype(np.float32))
    assert unseen.state is None
    assert unseen.reason


def test_a_flat_cloud_gives_the_same_state_and_nearly_the_same_angle() -> None:
    organized = see(door(40))
    flat = RULE(organized.reshape(-1, 3))
    assert flat.state == DoorState.SEMI_OPEN
    assert flat.opening_angle_deg == pytest.approx(40, abs=2)


def test_a_centimetre_of_noise_costs_little() -> None:
    seen = see(door(45))
    noise = np.random.default_rng(5).normal(0, 0.01, (*seen.shape[:2], 1))
    result = RULE((seen * (1 + noise / 2.5)).astype(np.float32))
    assert result.state == DoorState.SEMI_OPEN
    assert result.opening_angle_deg == pytest.approx(45, abs=4)


@pytest.mark.parametrize(
    "cloud",
    [
        np.empty((0, 3), np.float32),
        np.full((48, 64, 3), np.nan, np.float32),
        np.zeros((48, 64, 3), np.float32),
        see([]),
        see([((2.0, 0.4), (2.0, -0.4), -1.0, 1.0)]),
        see([((2.0, 0.05), (2.0, -0.05), -1.0, 1.0)]),
    ],
    ids=["empty", "all NaN", "zeros", "floor", "no wall", "tiny leaf"],
)
def test_scenes_without_a_door_have_a_reason(cloud: np.ndarray) -> None:
    result = RULE(cloud)
    assert result.state is None
    assert result.reason


def test_a_bare_wall_is_closed_like_a_flush_door() -> None:
    assert RULE(see([((2.5, 4.0), (2.5, -4.0), -1.0, 1.6)])).state == DoorState.CLOSED
