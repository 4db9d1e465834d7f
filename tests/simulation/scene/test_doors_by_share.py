# SPDX-License-Identifier: Apache-2.0
"""Bi-parting, folding and revolving doors, checked with the measures of a tape."""

from __future__ import annotations

import math

import pytest

from doorstate.simulation.scene import Door, Opening
from doorstate.simulation.scene.clearance import keep_out_boxes, passable_width_m
from doorstate.simulation.scene.door_boxes import fixed_boxes, leaf_boxes
from doorstate.simulation.scene.plan import collide
from doorstate.types import Part
from tests.simulation.scene.doors import LEVER, bare_leaves, span
from tests.simulation.scene.doors_by_share import (
    BI_FOLD,
    BI_PARTING,
    BY_SHARE,
    LIFT,
    REVOLVING,
    SHARES,
    TWO_PAIRS,
)

CLOSED, OPEN = SHARES[0], SHARES[-1]
by_share = pytest.mark.parametrize("door", BY_SHARE.values(), ids=BY_SHARE)


def free_m(door: Door, opening: Opening) -> float:
    """Return the widest gap of the leaves along x inside of the opening."""
    edge = door.opening_width_m / 2
    spans = sorted(span([box], 0) for box in bare_leaves(door, opening))
    ends = [-edge, *(max(-edge, min(edge, high)) for _, high in spans)]
    starts = [*(max(-edge, min(edge, low)) for low, _ in spans), edge]
    return max(start - max(ends[: number + 1]) for number, start in enumerate(starts))


@by_share
def test_a_closed_door_fills_its_opening(door: Door) -> None:
    low, high = span(bare_leaves(door, CLOSED), 0)
    half = door.opening_width_m / 2
    assert free_m(door, CLOSED) < 0.35 if door is REVOLVING else free_m(door, CLOSED) < 0.01
    assert high == pytest.approx(-low)
    assert high == pytest.approx(half, abs=0.031) or door is REVOLVING
    assert passable_width_m(door, CLOSED) < 0.01


@pytest.mark.parametrize("door", [BI_PARTING, LIFT, BI_FOLD, TWO_PAIRS], ids=lambda door: door.kind)
def test_the_passable_width_is_that_between_the_leaves(door: Door) -> None:
    widths = [passable_width_m(door, opening) for opening in SHARES]
    assert widths == sorted(widths)
    assert widths[-1] >= 0.85 * door.opening_width_m
    for opening, width in zip(SHARES, widths, strict=True):
        assert width == pytest.approx(free_m(door, opening), abs=0.01)


def test_bi_parting_leaves_move_apart_by_the_same_way() -> None:
    left, right = sorted(bare_leaves(BI_PARTING, Opening(share=0.5)), key=lambda box: -box.center_m[0])
    assert span([left], 0) == pytest.approx((0.4, 0.8 + 0.03 + 0.4))
    assert span([right], 0) == pytest.approx((-0.8 - 0.03 - 0.4, -0.4))
    track = max(
        (box for box in fixed_boxes(BI_PARTING) if box.part is Part.FRAME), key=lambda box: box.size_m[0]
    )
    assert span([track], 0) == pytest.approx((-1.6, 1.6))
    assert not collide(
        leaf_boxes(BI_PARTING, OPEN), [b for b in fixed_boxes(BI_PARTING) if b.part is Part.WALL]
    )
    inside = leaf_boxes(LIFT, OPEN)  # in the wall beside the opening
    assert all(abs(box.center_m[0]) - box.size_m[0] / 2 >= 0.45 - 1e-9 for box in inside)
    assert {box.material for box in inside} == {"gloss"}


@pytest.mark.parametrize("door", [BI_FOLD, TWO_PAIRS], ids=["bi-fold", "two pairs"])
@pytest.mark.parametrize("swing", ["towards", "away"])
def test_panels_stay_in_line_with_the_wall_at_their_ends_and_fold_to_one_side(door: Door, swing: str) -> None:
    door = door.model_copy(update={"swing": swing, "hinge": "right"})
    for opening in SHARES:
        panels = bare_leaves(door, opening)
        assert len(panels) == (door.panels or 2)
        for first, second in zip(panels[::2], panels[1::2], strict=True):
            assert second.yaw_rad == pytest.approx(-first.yaw_rad)
            assert first.center_m[1] == pytest.approx(second.center_m[1])
    middle_y = {box.center_m[1] for box in bare_leaves(door, OPEN)}
    face = 0.0 if swing == "towards" else -door.wall_thickness_m
    assert all((y > face) == (swing == "towards") for y in middle_y)


def test_panels_stop_where_they_are_folded_and_at_the_wall() -> None:
    for share, nearest in ((1.4, OPEN), (-0.2, CLOSED)):
        assert leaf_boxes(BI_FOLD, Opening(share=share)) == leaf_boxes(BI_FOLD, nearest)
    tiny = BI_FOLD.model_copy(update={"opening_width_m": 0.006})
    assert all(box.yaw_rad == 0 for box in leaf_boxes(tiny, OPEN))


def test_the_second_panel_has_the_handle() -> None:
    door = BI_FOLD.model_copy(update={"handle": LEVER, "hinge": "right"})
    handle = leaf_boxes(door, CLOSED)[2:]
    assert len(handle) == 2
    assert span(handle, 0)[1] == pytest.approx(0.447 - 0.065 + 0.01)


def test_glass_panels_are_counted_from_the_first() -> None:
    for door, panes in ((TWO_PAIRS, 3), (REVOLVING, 2), (BI_PARTING, 2)):
        glazed = leaf_boxes(door.model_copy(update={"glass_panels": panes}), CLOSED)
        assert sum(box.material == "glass" for box in glazed) == panes
        assert not any(box.material == "glass" for box in leaf_boxes(door, CLOSED))


def test_opposite_wings_are_glazed_first() -> None:
    door = REVOLVING.model_copy(update={"glass_panels": 2})
    first, second = (box for box in leaf_boxes(door, Opening(share=0.3)) if box.material == "glass")
    assert math.remainder(second.yaw_rad - first.yaw_rad - math.pi, 2 * math.pi) == pytest.approx(0)


def test_wings_turn_freely_in_the_drum_of_a_revolving_door() -> None:
    drum = [box for box in fixed_boxes(REVOLVING) if box.part is Part.FRAME]
    walls = [box for box in drum if box.center_m[2] < 2.0]
    for opening in SHARES:
        assert not collide(leaf_boxes(REVOLVING, opening), drum, 0.0)
        assert passable_width_m(REVOLVING, opening) == 0
    assert span(leaf_boxes(REVOLVING, Opening(share=0.5)), 1) == pytest.approx((-0.075 - 0.98, -0.075 + 0.98))
    # A person walks in from both sides, between the ends of the drum's walls.
    throat = 2 * 1.0 * math.sin(math.pi / 4)
    for y in (0.8, -0.95):
        body = drum[0]._replace(center_m=(0.0, y, 1.0), size_m=(throat - 0.1, 0.3, 1.8), yaw_rad=0.0)
        assert not collide([body], walls)
        assert collide([body._replace(size_m=(throat + 0.1, 0.3, 1.8))], walls)
    # The canopy covers all of the circle.
    top = [box for box in drum if box.center_m[2] > 2.0]
    for turn in range(0, 360, 5):
        at = (math.cos(math.radians(turn)), math.sin(math.radians(turn)) - 0.075, 2.2)
        assert collide([drum[0]._replace(center_m=at, size_m=(0.01, 0.01, 0.01))], top, 0.0)


@by_share
def test_what_stands_in_a_leaf_or_drum_is_found(door: Door) -> None:
    boxes = keep_out_boxes(door, SHARES)
    for leaf in (leaf for opening in SHARES for leaf in leaf_boxes(door, opening)):
        assert collide([leaf._replace(size_m=(0.02, 0.02, 0.02))], boxes)
    if door is REVOLVING:
        gap = leaf_boxes(door, CLOSED)[0]._replace(center_m=(0.0, 0.6, 0.5), size_m=(0.2, 0.2, 1.0))
        assert not collide([gap], leaf_boxes(door, CLOSED))
        assert collide([gap], boxes)


def test_a_door_without_jambs_has_the_passable_width_of_one_with_them() -> None:
    for angle in (0.0, 30.0, 90.0):
        opening = Opening(angle_deg=angle)
        bare = Door(jamb_thickness_m=0.0, casing_width_m=0.0, stop_width_m=0.0)
        assert passable_width_m(bare, opening) == pytest.approx(passable_width_m(Door(), opening))
        assert {box.part for box in fixed_boxes(bare)} == {Part.WALL}


def test_a_leaf_at_the_far_face_turns_along_the_reveal() -> None:
    door = Door(wall_thickness_m=0.3, leaf_recess_m=0.26, stop_width_m=0.0, hinge_offset_m=0.005)
    (leaf,) = leaf_boxes(door, CLOSED)
    assert span([leaf], 1) == pytest.approx((-0.3, -0.26))
    for angle in (30.0, 60.0, 90.0):
        assert not collide(leaf_boxes(door, Opening(angle_deg=angle)), fixed_boxes(door))
