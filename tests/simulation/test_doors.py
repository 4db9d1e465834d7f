# SPDX-License-Identifier: Apache-2.0
"""Doors of many kinds: what a tape measure, a protractor and a shoulder would say."""

from __future__ import annotations

import math

import numpy as np
import pytest

from doorstate.simulation.door_draws import ANGLES_DEG, SLID_SHARES, draw_door, state_of
from doorstate.simulation.doors import (
    DoorKind,
    Opening,
    VariedDoor,
    door_boxes,
    fixed_boxes,
    free_angle_deg,
    leaf_boxes,
    passable_width_m,
)
from doorstate.simulation.draws import Draws
from doorstate.simulation.handles import Handle
from doorstate.simulation.plan import collide, footprint
from doorstate.simulation.scene import Box, Door, build_scene
from doorstate.types import DoorState, Part

LEVER = Handle(kind="lever", height_m=1.0, projection_m=0.06, length_m=0.13)
DOORS = [draw_door(Draws(7, index, "doors")) for index in range(120)]
HINGED = [door for door in DOORS if not door.is_sliding]


def spans(boxes: list[Box], axis: int) -> tuple[float, float]:
    if axis == 2:
        return (
            min(box.center_m[2] - box.size_m[2] / 2 for box in boxes),
            max(box.center_m[2] + box.size_m[2] / 2 for box in boxes),
        )
    values = [corner[axis] for box in boxes for corner in footprint(box)]
    return min(values), max(values)


def slabs(door: VariedDoor, opening: Opening) -> list[Box]:
    """Leaves without handles."""
    return leaf_boxes(door.model_copy(update={"handle": None}), opening)


@pytest.mark.parametrize("hinge", ["left", "right"])
@pytest.mark.parametrize("swing", ["away", "towards"])
@pytest.mark.parametrize("angle_deg", [0.0, 50.0])
def test_a_plain_one_is_the_door_of_the_first_presets(hinge: str, swing: str, angle_deg: float) -> None:
    settings = {"hinge": hinge, "swing": swing}
    plain = build_scene(Door.model_validate(settings), math.radians(angle_deg))[:-1]  # without the floor
    varied = door_boxes(VariedDoor.model_validate(settings), Opening(angle_deg=angle_deg))

    def outlines(boxes: list[Box]) -> np.ndarray:
        lines = [
            (box.part, *np.round(np.ravel(sorted(footprint(box))), 9), *spans([box], 2)) for box in boxes
        ]
        return np.array(sorted(lines))

    np.testing.assert_allclose(outlines(varied), outlines(plain), atol=1e-8)


@pytest.mark.parametrize("door", DOORS[:60], ids=lambda door: door.kind)
def test_a_closed_door_fills_its_opening(door: VariedDoor) -> None:
    leaves = slabs(door, Opening())
    low, high = spans(leaves, 0)
    half = door.opening_width_m / 2
    assert low == pytest.approx(-half, abs=0.031)
    assert high == pytest.approx(half, abs=0.031)
    bottom, top = spans(leaves, 2)
    assert bottom == pytest.approx(door.threshold_m + 0.006)
    assert top == pytest.approx(door.opening_height_m, abs=0.031)
    assert passable_width_m(door, Opening()) < 0.07


@pytest.mark.parametrize("door", HINGED[:50], ids=lambda door: door.kind)
def test_a_leaf_swings_to_its_side_and_stays_on_its_hinge(door: VariedDoor) -> None:
    faces = door.swing == "towards"
    edge = -door.wall_thickness_m if not faces else 0.0
    side = 1 if door.hinge == "left" else -1
    for angle in (30.0, 60.0, 90.0):
        active = slabs(door, Opening(angle_deg=angle))
        if door.is_double:
            active = active[:1]
        reach = spans(active, 1)[1] - edge if faces else edge - spans(active, 1)[0]
        width = door.active_share * door.opening_width_m
        recess = door.leaf_recess_m
        assert reach == pytest.approx(width * math.sin(math.radians(angle)) - recess, abs=0.06)
        hinge_x = spans(active, 0)[1 if side > 0 else 0]
        assert hinge_x * side == pytest.approx(door.opening_width_m / 2, abs=0.06)


@pytest.mark.parametrize("door", HINGED, ids=lambda door: door.kind)
def test_a_leaf_turns_as_far_as_it_says_and_through_nothing(door: VariedDoor) -> None:
    free = free_angle_deg(door, [])
    assert free >= 90
    around = fixed_boxes(door)
    for angle in np.linspace(0, free, 9):
        assert not collide(leaf_boxes(door, Opening(angle_deg=angle)), around)
    if door.leaf_recess_m == 0:
        assert free == 170


def test_a_wall_beside_the_hinge_stops_the_leaf() -> None:
    door = VariedDoor(hinge="left", swing="towards", hinge_offset_m=0.0125)
    # 0.6 m beside the hinge: a leaf of 0.894 m meets it at 90 + asin(0.6 / 0.894) = 132 degrees.
    wall = Box(Part.WALL, (0.45 + 0.6 + 0.05, 2.0, 1.3), (0.1, 4.0, 2.6))
    assert free_angle_deg(door, [wall]) == 130
    assert free_angle_deg(door.model_copy(update={"hinge": "right"}), [wall]) == 170
    near = wall._replace(center_m=(0.45 + 0.03 + 0.05, 2.0, 1.3))
    assert free_angle_deg(door, [near]) == 90
    assert free_angle_deg(door.model_copy(update={"handle": LEVER}), [near]) == 85  # 0.06 m before the leaf


def test_passable_widths_are_those_of_a_tape_measure() -> None:
    door = VariedDoor()  # 0.90 m, leaf 0.894 x 0.04 m, hinged flush with the robot's wall face
    assert passable_width_m(door, Opening()) == pytest.approx(0.003)
    half_open = passable_width_m(door, Opening(angle_deg=45))
    # From the jamb's corner at right angles to the leaf's inner face, 0.04 m behind the face with the hinge.
    assert half_open == pytest.approx((0.9 - 0.003) * math.sin(math.radians(45)) - 0.04, abs=1e-6)
    # At a right angle the leaf stands in the opening with its thickness.
    assert passable_width_m(door, Opening(angle_deg=90)) == pytest.approx(0.9 - 0.003 - 0.04)
    double = VariedDoor(kind="double_equal", opening_width_m=1.6, active_share=0.5)
    one_leaf = passable_width_m(double, Opening(angle_deg=90))
    assert one_leaf == pytest.approx(0.8 - 0.04, abs=0.006)
    both = passable_width_m(double, Opening(angle_deg=90, passive_angle_deg=90))
    assert both == pytest.approx(1.6 - 2 * 0.043)
    sliding = VariedDoor(kind="sliding", leaf_recess_m=-0.06, stop_width_m=0.0)
    # The leaf runs in front of the wall and is 0.03 m wider than the opening on each side.
    assert passable_width_m(sliding, Opening(share=0.5)) == pytest.approx(0.42)
    assert passable_width_m(sliding, Opening(share=0.02)) == 0
    in_the_wall = sliding.model_copy(update={"leaf_recess_m": 0.05})
    assert passable_width_m(in_the_wall, Opening(share=0.5)) == pytest.approx(0.45)


@pytest.mark.parametrize("door", DOORS, ids=lambda door: door.kind)
def test_more_open_is_more_passable_and_never_wider_than_the_opening(door: VariedDoor) -> None:
    steps = [Opening(share=s) if door.is_sliding else Opening(angle_deg=90 * s) for s in (0, 0.2, 0.5, 0.8)]
    widths = [passable_width_m(door, step) for step in steps]
    assert widths == sorted(widths)
    assert widths[-1] <= door.opening_width_m


def test_a_sliding_leaf_moves_to_its_side_along_its_face() -> None:
    for hinge, side in (("left", 1), ("right", -1)):
        for swing, face in (("towards", 1), ("away", -1)):
            door = VariedDoor.model_validate(
                {
                    "kind": "sliding",
                    "hinge": hinge,
                    "swing": swing,
                    "leaf_recess_m": -0.07,
                    "stop_width_m": 0.0,
                }
            )
            (leaf,) = slabs(door, Opening(share=0.5))
            assert leaf.center_m[0] == pytest.approx(side * 0.45)
            middle = leaf.center_m[1] + (0.15 if face < 0 else 0.0)
            assert middle == pytest.approx(face * (0.03 + 0.02))
            assert not collide([leaf], [box for box in fixed_boxes(door) if box.part == Part.WALL], 0.0)


@pytest.mark.parametrize(("kind", "panes"), [("single", 0), ("glazed", 1), ("full_glass", 1)])
def test_glass_is_where_the_kind_says(kind: DoorKind, panes: int) -> None:
    door = next(door for door in DOORS if door.kind == kind)
    leaf = slabs(door, Opening())
    glass = [box for box in leaf if box.material == "glass"]
    assert len(glass) == panes
    if glass:
        share = glass[0].size_m[0] * glass[0].size_m[2] / (door.opening_width_m * door.opening_height_m)
        assert share > (0.9 if kind == "full_glass" else 0.15)
        # A pane is held: it touches the other parts and lies within the leaf's thickness.
        assert collide(glass, [box for box in leaf if box.material != "glass"], -0.001)


@pytest.mark.parametrize("kind", ["lever", "knob", "bar"])
def test_handles_are_fixed_to_both_faces_near_the_free_edge(kind: str) -> None:
    handle = LEVER.model_copy(update={"kind": kind, "length_m": 0.5 if kind == "bar" else 0.13})
    door = VariedDoor(hinge="right", handle=handle)
    bare = slabs(door, Opening())
    parts = leaf_boxes(door, Opening())[len(bare) :]
    assert all(collide([part], [*bare, *(p for p in parts if p != part)], -0.001) for part in parts)
    low, high = spans(parts, 1)
    assert (low, high) == pytest.approx((-0.04 - 0.06, 0.06))
    assert spans(parts, 0)[1] == pytest.approx(0.447 - 0.065, abs=0.03)
    assert sum(spans(parts, 2)) / 2 == pytest.approx(1.0, abs=0.001)


@pytest.mark.parametrize(
    ("angle", "state", "ambiguous"),
    [
        *((0.0, DoorState.CLOSED, False), (3.0, DoorState.CLOSED, False), (8.9, DoorState.CLOSED, True)),
        *(
            (9.1, DoorState.SEMI_OPEN, True),
            (15.0, DoorState.SEMI_OPEN, False),
            (69.9, DoorState.SEMI_OPEN, True),
        ),
        *((70.1, DoorState.OPEN, True), (75.0, DoorState.OPEN, False), (160.0, DoorState.OPEN, False)),
    ],
)
def test_states_by_angle(angle: float, state: DoorState, ambiguous: bool) -> None:
    assert state_of(VariedDoor(), Opening(angle_deg=angle)) == (state, ambiguous)


def test_states_of_a_sliding_door_by_its_share() -> None:
    door = VariedDoor(kind="sliding")
    found = [state_of(door, Opening(share=share)) for share in (0.0, 0.1, 0.13, 0.3, 0.7, 0.75, 0.9)]
    closed, semi, opened = DoorState
    assert [state for state, _ in found] == [closed, closed, semi, semi, semi, opened, opened]
    assert [ambiguous for _, ambiguous in found] == [False, True, True, False, True, True, False]
    assert ANGLES_DEG.keys() == SLID_SHARES.keys() == set(DoorState)
