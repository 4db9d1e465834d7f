# SPDX-License-Identifier: Apache-2.0
"""Tests of doorstate.doorways.evidence."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from doorstate.doorways.doorway import Doorway
from doorstate.doorways.evidence import find_evidence
from doorstate.doorways.finder import thinned
from doorstate.doorways.measured_view import MeasuredView
from tests.doorways import scenes
from tests.doorways.scenes import HandMade


def _doorway(made: HandMade) -> Doorway:
    true = made.doors[0]
    return Doorway(true.x_m, true.y_m, true.yaw_deg, true.width_m, made.floor_z_m)


@cache
def _dark() -> tuple[np.ndarray, Doorway]:
    made = scenes.dark_leaf()
    return thinned(made.points), _doorway(made)


def test_shares_of_an_opening_sum_to_one() -> None:
    for make in (scenes.dark_leaf, scenes.glass_leaf_seen_through, scenes.lower_leaf_from_near_the_floor):
        made = make()
        evidence = find_evidence(MeasuredView(thinned(made.points)), _doorway(made))
        total = evidence.on_wall + evidence.through + evidence.hidden + evidence.missing
        assert total == pytest.approx(1.0)
        assert 0 < evidence.in_view <= 1
        assert 0 <= evidence.flush <= 1
        assert evidence.nearest_m < evidence.rim_m < evidence.farthest_m


def test_a_dark_leaf_is_missing_and_the_floor_before_it_is_there() -> None:
    points, doorway = _dark()
    evidence = find_evidence(MeasuredView(points), doorway)
    assert evidence.missing > 0.8
    assert evidence.has_floor_before
    assert evidence.rim_m == pytest.approx(doorway.distance_m, abs=0.5)


def test_the_order_of_the_points_does_not_matter() -> None:
    points, doorway = _dark()
    shuffled = np.random.default_rng(0).permutation(points)
    first, second = (find_evidence(MeasuredView(cloud), doorway) for cloud in (points, shuffled))
    # Means of float32 depths, and samples for the ranges, depend on the order.
    shares = ("in_view", "on_wall", "through", "hidden", "missing", "flush")
    for name in (*shares, "rim_m", "hole_m", "nearest_m"):
        assert getattr(second, name) == pytest.approx(getattr(first, name), abs=0.05, nan_ok=True)
    assert second.has_floor_before == first.has_floor_before


def test_points_far_beside_the_door_do_not_matter() -> None:
    points, doorway = _dark()
    near = points[np.abs(doorway.to_doorway(points)[:, 0]) < 1.3]
    full, cut = find_evidence(MeasuredView(points), doorway), find_evidence(MeasuredView(near), doorway)
    assert (cut.on_wall, cut.through, cut.hidden, cut.missing) == pytest.approx(
        (full.on_wall, full.through, full.hidden, full.missing), abs=0.05
    )


def test_a_wall_without_points_has_nothing_in_view() -> None:
    _, doorway = _dark()
    evidence = find_evidence(MeasuredView(np.array([[1.0, 9.0, 0.0]], np.float32)), doorway)
    assert (evidence.in_view, evidence.missing) == (0.0, 0.0)
    assert np.isnan(evidence.rim_m)
