# SPDX-License-Identifier: Apache-2.0
"""Lane ahead: blocked, partly blocked, free, and never free where readings are missing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.rules.depth_region import DepthRegionParameters, DepthRegionRule
from doorstate.types import DoorState
from tests.rules.hand_made import Rectangle, door, see

RULE = DepthRegionRule()


def _frame() -> list[Rectangle]:
    *frame, _ = door(0, distance_m=2.0)
    return frame


@pytest.mark.parametrize("distance", [1.0, 2.0, 3.5])
def test_a_surface_across_the_lane_is_closed(distance: float) -> None:
    result = RULE(see(door(0, distance_m=distance)))
    assert result.state == DoorState.CLOSED
    assert result.opening_angle_deg is None
    assert result.detections[0].points_m[:, 0] == pytest.approx(distance, abs=0.05)


def test_a_free_lane_is_open_though_the_lintel_is_above_it() -> None:
    assert RULE(see(_frame())).state == DoorState.OPEN


def test_a_leaf_in_part_of_the_lane_is_semi_open() -> None:
    assert RULE(see([*_frame(), ((1.6, 0.45), (1.5, 0.05), -0.99, 1.0)])).state == DoorState.SEMI_OPEN


def test_a_surface_beyond_the_reach_leaves_the_way_free() -> None:
    seen = see(door(0, distance_m=3.5))
    assert DepthRegionRule(DepthRegionParameters(reach_m=2.0))(seen).state == DoorState.OPEN


@settings(max_examples=25, derandomize=True)
@given(seed=st.integers(0, 99), share=st.floats(0, 1), left=st.integers(0, 319), right=st.integers(0, 319))
def test_no_loss_of_readings_opens_a_closed_door(seed: int, share: float, left: int, right: int) -> None:
    seen = see(door(0, distance_m=2.0))
    lost = np.random.default_rng(seed).random(seen.shape[:2]) < share
    lost[:, min(left, right) : max(left, right)] = True
    result = RULE(np.where(lost[..., None], np.nan, seen).astype(np.float32))
    assert result.state in (DoorState.CLOSED, None)


def test_an_open_lane_with_an_unmeasured_strip_has_no_state() -> None:
    seen = see(_frame())
    seen[:, 150:170] = np.nan
    result = RULE(seen)
    assert result.state is None
    assert result.reason


def test_a_black_leaf_under_a_window_is_not_open() -> None:
    seen = see([*_frame(), ((4.5, 3.0), (4.5, -3.0), -1.0, 1.6)])
    seen[120:] = np.nan  # the leaf and the floor; above it the room behind is measured
    result = RULE(seen)
    assert result.state is None


def test_flat_and_organized_clouds_agree() -> None:
    for scene in (door(0), _frame()):
        seen = see(scene)
        assert RULE(seen.reshape(-1, 3)).state == RULE(seen).state is not None


@pytest.mark.parametrize(
    "cloud",
    [
        np.empty((0, 3), np.float32),
        np.full((48, 64, 3), np.nan, np.float32),
        np.zeros((48, 64, 3), np.float32),
        np.full((900, 3), np.nan, np.float32),
    ],
    ids=["empty", "all NaN", "zeros", "flat NaN"],
)
def test_clouds_without_points_have_a_reason(cloud: np.ndarray) -> None:
    result = RULE(cloud)
    assert result.state is None
    assert result.reason
