# SPDX-License-Identifier: Apache-2.0
"""Contract of every rule: a state or a reason for any cloud, and the same result every time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.rules import create_rule, list_rules
from tests.rules.hand_made import door, see


@pytest.mark.parametrize("name", list_rules())
def test_the_same_cloud_has_the_same_result(name: str) -> None:
    cloud = see(door(40.0))
    first, second = create_rule(name)(cloud), create_rule(name)(cloud.copy())
    assert (first.state, first.reason, first.opening_angle_deg) == (
        second.state,
        second.reason,
        second.opening_angle_deg,
    )
    for before, after in zip(first.detections, second.detections, strict=True):
        np.testing.assert_array_equal(before.points_m, after.points_m)


@settings(max_examples=60, derandomize=True)
@given(
    name=st.sampled_from(list_rules()),
    seed=st.integers(0, 999),
    count=st.sampled_from([1, 3, 70, 3000]),
    flat=st.sampled_from([(1, 1, 1), (0, 1, 1), (1, 0, 1), (1, 1, 0), (0, 0, 1), (0, 0, 0)]),
    unit=st.sampled_from([0.01, 1.0, 1000.0, 1e37]),
)
def test_random_points_never_raise(
    name: str, seed: int, count: int, flat: tuple[int, int, int], unit: float
) -> None:
    points = np.random.default_rng(seed).normal(0, 1, (count, 3)) * flat + [2.0, 0.0, 0.1]
    result = create_rule(name)((points * unit).astype(np.float32))
    assert (result.state is None) == bool(result.reason)
