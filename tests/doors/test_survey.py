# SPDX-License-Identifier: Apache-2.0
"""Doors for a list: sights of one place are one door, from either side, and doors of the list are left out."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.doors.plane_pose import PlanePose, turned_deg
from doorstate.doors.survey import map_doors, survey_doors
from tests.doors.examples import AT_ORIGIN, named, seen, seen_from

DOORS = (named("a", 3.0, 0.6), named("b", 3.0, -0.6), named("c", 6.0, 2.0, yaw_deg=180.0))


def test_sights_from_many_places_are_one_door_each() -> None:
    rng = np.random.default_rng(0)
    sights = []
    for x_m in np.linspace(-1.0, 1.0, 9):
        camera = AT_ORIGIN._replace(pose=PlanePose(float(x_m), 0.3, float(rng.uniform(-20, 20))))
        for door in DOORS:
            exact = seen_from(camera, door)
            moved = seen(
                exact.x_m + rng.normal(0, 0.04),
                exact.y_m + rng.normal(0, 0.04),
                exact.yaw_deg + rng.normal(0, 2),
                hinge="left" if rng.random() < 0.8 else "right",
                door_probability=0.9,
            )
            sights += map_doors([moved], camera)
    doors = survey_doors(sights, [], min_views=3)
    assert [door.id for door in doors] == ["door-1", "door-2", "door-3"]
    for found, true in zip(doors, DOORS, strict=True):
        assert found.place[:2] == pytest.approx(true.place[:2], abs=0.06)
        assert abs(turned_deg(found.place.yaw_deg - true.place.yaw_deg)) < 3
        assert (found.width_m, found.hinge) == (0.9, "left")


def test_a_door_of_the_list_is_not_added_again() -> None:
    sights = map_doors([seen(3.0, 0.6), seen(3.0, -0.6)], AT_ORIGIN)
    known = [named("Door-1", 3.0, 0.55)]
    assert [door.id for door in survey_doors(sights, known)] == ["door-2"]
    assert [door.id for door in survey_doors(sights, known, name="hall")] == ["hall-1"]


def test_a_door_seen_from_behind_is_the_same_door() -> None:
    behind = AT_ORIGIN._replace(pose=PlanePose(6.0, 0.6, 180.0))
    sights = map_doors([seen_from(AT_ORIGIN, DOORS[0], hinge="left")], AT_ORIGIN)
    sights += map_doors([seen_from(behind, DOORS[0], hinge="right")] * 3, behind)
    (door,) = survey_doors(sights, [])
    assert (door.place, door.hinge) == (PlanePose(3.0, 0.6, 90.0), "left")


def test_unlikely_doors_and_rare_ones_are_left_out() -> None:
    sights = map_doors([seen(3.0, 0.6, door_probability=0.42)], AT_ORIGIN)
    assert sights == []
    sights = map_doors([seen(3.0, 0.6, door_probability=0.9)], AT_ORIGIN)
    assert survey_doors(sights, [], min_views=2) == []
