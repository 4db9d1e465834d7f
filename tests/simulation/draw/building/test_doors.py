# SPDX-License-Identifier: Apache-2.0
"""Doors of buildings: all kinds, and each one can be built, opened and written."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import pytest

from doorstate.simulation.draw.building.doors import KIND_WEIGHTS, draw_building_door, draw_lift_door
from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene import Door, Opening
from doorstate.simulation.scene.clearance import free_angle_deg, passable_width_m
from doorstate.simulation.scene.door_boxes import door_boxes, fixed_boxes, leaf_boxes
from doorstate.simulation.scene.plan import collide
from doorstate.types import Part

DOORS = [draw_building_door(Stream(3, index, "building")) for index in range(400)]
SOME = DOORS[:120]
some = pytest.mark.parametrize("door", SOME, ids=lambda door: door.kind)


def test_kinds_are_drawn_by_their_weights() -> None:
    counts = Counter(door.kind for door in DOORS)
    assert sum(KIND_WEIGHTS.values()) == pytest.approx(1.0)
    for kind, weight in KIND_WEIGHTS.items():
        assert counts[kind] / len(DOORS) == pytest.approx(weight, abs=0.06)
        assert counts[kind] > 0


def test_doors_have_all_fittings_materials_and_places_in_the_wall() -> None:
    assert {door.leaf_material for door in DOORS} == {None, "dark", "gloss"}
    kinds = {fitting.kind for door in DOORS for fitting in door.fittings or ()}
    assert kinds == {"vision_panel", "letter_slot", "kick_plate", "push_plate", "push_bar", "viewer"}
    single = [door for door in DOORS if door.kind == "single"]
    assert any(door.leaf_recess_m == 0 for door in single)
    assert any(door.leaf_recess_m > 0.15 for door in single)
    frameless = [door for door in single if door.casing_width_m == 0]
    assert 0.1 < len(frameless) / len(single) < 0.3
    assert all(door.stop_width_m == 0 for door in frameless)
    assert {door.panels for door in DOORS if door.kind == "folding"} == {2, 4}


def test_the_same_stream_gives_the_same_door() -> None:
    assert draw_building_door(Stream(3, 5, "building")) == DOORS[5]
    assert Door.model_validate_json(DOORS[5].model_dump_json(exclude_none=True)) == DOORS[5]


def test_a_given_wall_and_kind_are_kept() -> None:
    for index in range(20):
        door = draw_building_door(Stream(0, index, "wall"), (0.12, 2.5), {"folding": 1.0})
        assert (door.wall_thickness_m, door.wall_height_m, door.kind) == (0.12, 2.5, "folding")


@some
def test_boxes_of_a_door_have_a_size_and_its_leaves_stay_in_their_wall_when_closed(door: Door) -> None:
    boxes = door_boxes(door, Opening())
    assert min(min(box.size_m) for box in boxes) > 0
    assert {Part.WALL, Part.LEAF} <= {box.part for box in boxes}
    assert door.leaf_recess_m + door.leaf_thickness_m <= door.wall_thickness_m + 1e-9
    assert door.opening_height_m < door.wall_height_m
    closed = passable_width_m(door, Opening())
    assert closed < 0.08


@some
def test_leaves_open_without_collision(door: Door) -> None:
    if door.opens_by_share:
        openings = [Opening(share=share) for share in (0.0, 0.3, 0.6, 1.0)]
        fixed = [box for box in fixed_boxes(door) if door.kind == "folding" or box.part is Part.FRAME]
        if door.leaf_recess_m > 0 and door.is_sliding:
            fixed = []  # its leaves move into the wall
    else:
        free = free_angle_deg(door, [])
        assert free >= 85
        openings = [Opening(angle_deg=angle) for angle in (0.0, 30.0, 60.0, float(free))]
        fixed = fixed_boxes(door)
    for opening in openings:
        assert not collide(leaf_boxes(door, opening), fixed)
    widths = [passable_width_m(door, opening) for opening in openings]
    assert all(wider >= narrower - 1e-9 for narrower, wider in pairwise(widths))
    assert widths[-1] <= door.opening_width_m


def test_lift_doors_are_of_metal_and_part_in_the_wall() -> None:
    for index in range(30):
        door = draw_lift_door(Stream(0, index, "lift"))
        assert (door.kind, door.leaf_material, door.handle) == ("sliding_double", "gloss", None)
        assert 0 <= door.leaf_recess_m <= 0.1
        assert passable_width_m(door, Opening(share=1.0)) == door.opening_width_m
