# SPDX-License-Identifier: Apache-2.0
"""Passable widths and free angles of doors."""

from __future__ import annotations

import math

import numpy as np
import pytest

from doorstate.simulation.scene import Box, Door, Opening
from doorstate.simulation.scene.clearance import free_angle_deg, passable_width_m
from doorstate.simulation.scene.door_boxes import fixed_boxes, leaf_boxes
from doorstate.simulation.scene.plan import collide
from doorstate.types import Part
from tests.simulation.scene.doors import DOORS, HINGED, LEVER


@pytest.mark.parametrize("door", HINGED, ids=lambda door: door.kind)
def test_a_leaf_turns_to_its_free_angle_without_collision(door: Door) -> None:
    free = free_angle_deg(door, [])
    assert free >= 90
    fixed = fixed_boxes(door)
    for angle in np.linspace(0, free, 9):
        assert not collide(leaf_boxes(door, Opening(angle_deg=angle)), fixed)
    if door.leaf_recess_m == 0:
        assert free == 170


def test_a_wall_beside_the_hinge_stops_the_leaf() -> None:
    door = Door(hinge="left", swing="towards", hinge_offset_m=0.0125)
    # 0.6 m beside the hinge: a leaf of 0.894 m meets it at 90 + asin(0.6 / 0.894) = 132 degrees.
    wall = Box(Part.WALL, (0.45 + 0.6 + 0.05, 2.0, 1.3), (0.1, 4.0, 2.6))
    assert free_angle_deg(door, [wall]) == 130
    assert free_angle_deg(door.model_copy(update={"hinge": "right"}), [wall]) == 170
    near = wall._replace(center_m=(0.45 + 0.03 + 0.05, 2.0, 1.3))
    assert free_angle_deg(door, [near]) == 90
    assert free_angle_deg(door.model_copy(update={"handle": LEVER}), [near]) == 85  # 0.06 m before the leaf


def test_passable_widths_of_single_double_and_sliding_doors() -> None:
    door = Door()  # 0.90 m, leaf 0.894 x 0.04 m, hinged flush with the robot's wall face
    assert passable_width_m(door, Opening()) == pytest.approx(0.003)
    half_open = passable_width_m(door, Opening(angle_deg=45))
    # From the jamb's corner at a right angle to the leaf's inner face, 0.04 m behind the face with the hinge.
    assert half_open == pytest.approx((0.9 - 0.003) * math.sin(math.radians(45)) - 0.04, abs=1e-6)
    # At 90 degrees the leaf stands in the opening with its thickness.
    assert passable_width_m(door, Opening(angle_deg=90)) == pytest.approx(0.9 - 0.003 - 0.04)
    double = Door(kind="double_equal", opening_width_m=1.6, active_share=0.5)
    active_alone = passable_width_m(double, Opening(angle_deg=90))
    assert active_alone == pytest.approx(0.8 - 0.04, abs=0.006)
    both = passable_width_m(double, Opening(angle_deg=90, passive_angle_deg=90))
    assert both == pytest.approx(1.6 - 2 * 0.043)
    sliding = Door(kind="sliding", leaf_recess_m=-0.06, stop_width_m=0.0)
    # The leaf runs in front of the wall and is 0.03 m wider than the opening on each side.
    assert passable_width_m(sliding, Opening(share=0.5)) == pytest.approx(0.42)
    assert passable_width_m(sliding, Opening(share=0.02)) == 0
    in_the_wall = sliding.model_copy(update={"leaf_recess_m": 0.05})
    assert passable_width_m(in_the_wall, Opening(share=0.5)) == pytest.approx(0.45)


@pytest.mark.parametrize("door", DOORS, ids=lambda door: door.kind)
def test_passable_widths_grow_with_the_opening_up_to_its_width(door: Door) -> None:
    steps = [Opening(share=s) if door.is_sliding else Opening(angle_deg=90 * s) for s in (0, 0.2, 0.5, 0.8)]
    widths = [passable_width_m(door, step) for step in steps]
    assert widths[0] < 0.07
    assert widths == sorted(widths)
    assert widths[-1] <= door.opening_width_m
