# SPDX-License-Identifier: Apache-2.0
"""Boxes of doors, checked with the measures of a tape and a protractor."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from doorstate.simulation.scene import Box, Door, DoorKind, Opening, Scene, scene_boxes
from doorstate.simulation.scene.door_boxes import door_boxes, fixed_boxes, leaf_boxes
from doorstate.simulation.scene.plan import collide
from doorstate.types import Hinge, Part, Swing
from tests.simulation.scene.doors import DOORS, HINGED, LEVER, bare_leaves, span

hinges: st.SearchStrategy[Hinge] = st.sampled_from(("left", "right"))
swings: st.SearchStrategy[Swing] = st.sampled_from(("away", "towards"))


def vertical_edge(leaf: Box, x_sign: float, y_sign: float) -> np.ndarray:
    """Return a vertical edge of the leaf in plan."""
    x, y = x_sign * leaf.size_m[0] / 2, y_sign * leaf.size_m[1] / 2
    cos, sin = math.cos(leaf.yaw_rad), math.sin(leaf.yaw_rad)
    return np.array([leaf.center_m[0] + x * cos - y * sin, leaf.center_m[1] + x * sin + y * cos])


@given(
    hinge=hinges,
    swing=swings,
    angle_deg=st.floats(0, 180),
    width=st.floats(0.6, 1.2),
    wall=st.floats(0.08, 0.3),
)
@settings(max_examples=60)
def test_the_leaf_turns_about_a_fixed_hinge(
    hinge: Hinge, swing: Swing, angle_deg: float, width: float, wall: float
) -> None:
    door = Door(hinge=hinge, swing=swing, opening_width_m=width, wall_thickness_m=wall)
    side, face = (1 if hinge == "left" else -1), (-1 if swing == "away" else 1)
    (leaf,) = leaf_boxes(door, Opening(angle_deg=angle_deg))
    hinge_m = np.array([side * (width / 2 - 0.003), -wall if swing == "away" else 0.0])
    np.testing.assert_allclose(vertical_edge(leaf, side, face), hinge_m, atol=1e-12)
    free = vertical_edge(leaf, -side, face) - hinge_m
    # The free edge moves from across the opening to the side that the door swings to.
    angle = math.radians(angle_deg)
    expected = (width - 0.006) * np.array([-side * math.cos(angle), face * math.sin(angle)])
    np.testing.assert_allclose(free, expected, atol=1e-12)


@pytest.mark.parametrize("hinge", ["left", "right"])
@pytest.mark.parametrize("swing", ["away", "towards"])
def test_a_closed_leaf_fills_the_opening_except_for_its_gaps(hinge: Hinge, swing: Swing) -> None:
    (leaf,) = leaf_boxes(Door(hinge=hinge, swing=swing), Opening())
    assert leaf.size_m == pytest.approx((0.894, 0.04, 2.091))
    assert leaf.center_m == pytest.approx((0.0, -0.02 if swing == "towards" else -0.13, 0.006 + 2.091 / 2))


def test_the_wall_leaves_exactly_the_opening_and_its_jambs() -> None:
    door = Door(opening_width_m=1.0, opening_height_m=2.0)
    walls = [box for box in door_boxes(door, Opening()) if box.part == Part.WALL]
    spans = sorted(
        (box.center_m[0] - box.size_m[0] / 2, box.center_m[0] + box.size_m[0] / 2) for box in walls
    )
    np.testing.assert_allclose(spans, [(-6, -0.53), (-0.53, 0.53), (0.53, 6)])
    lintel = next(box for box in walls if box.center_m[0] == 0)
    assert lintel.center_m[2] - lintel.size_m[2] / 2 == pytest.approx(2.03)
    assert {box.center_m[1] + box.size_m[1] / 2 for box in walls} == {0.0}  # the robot's face


def test_only_the_stop_projects_into_the_opening() -> None:
    door = Door()
    for box in fixed_boxes(door):
        if box.part != Part.FRAME:
            continue
        inner_x = abs(box.center_m[0]) - box.size_m[0] / 2
        is_post = box.center_m[0] != 0
        low_z = box.center_m[2] - box.size_m[2] / 2
        gap = inner_x - door.opening_width_m / 2 if is_post else low_z - door.opening_height_m
        assert gap == pytest.approx(0) or gap == pytest.approx(-door.stop_width_m)


def test_a_misspelt_size_is_refused() -> None:
    with pytest.raises(ValidationError, match="opening_widht_m"):
        Door.model_validate({"opening_widht_m": 0.9})


def test_a_scene_has_a_door_or_a_feature() -> None:
    with pytest.raises(ValidationError, match="either a door or a feature"):
        Scene()
    bare = Scene(door=Door(), has_ceiling=False)
    assert {box.part for box in scene_boxes(bare, Opening())} == {
        Part.WALL,
        Part.FRAME,
        Part.LEAF,
        Part.FLOOR,
    }
    assert Part.CEILING in {box.part for box in scene_boxes(Scene(door=Door()), Opening())}


@pytest.mark.parametrize("door", DOORS[:60], ids=lambda door: door.kind)
def test_a_closed_door_of_any_kind_fills_its_opening(door: Door) -> None:
    leaves = bare_leaves(door, Opening())
    low, high = span(leaves, 0)
    half = door.opening_width_m / 2
    assert low == pytest.approx(-half, abs=0.031)
    assert high == pytest.approx(half, abs=0.031)
    bottom, top = span(leaves, 2)
    assert bottom == pytest.approx(door.threshold_m + 0.006)
    assert top == pytest.approx(door.opening_height_m, abs=0.031)


@pytest.mark.parametrize("door", HINGED[:50], ids=lambda door: door.kind)
def test_a_leaf_of_any_kind_swings_to_its_side_and_stays_on_its_hinge(door: Door) -> None:
    towards = door.swing == "towards"
    face_y = 0.0 if towards else -door.wall_thickness_m
    side = 1 if door.hinge == "left" else -1
    for angle in (30.0, 60.0, 90.0):
        active = bare_leaves(door, Opening(angle_deg=angle))
        if door.is_double:
            active = active[:1]
        reach = span(active, 1)[1] - face_y if towards else face_y - span(active, 1)[0]
        width = door.active_share * door.opening_width_m
        expected = width * math.sin(math.radians(angle)) - door.leaf_recess_m
        assert reach == pytest.approx(expected, abs=0.06)
        hinge_x = span(active, 0)[1 if side > 0 else 0]
        assert hinge_x * side == pytest.approx(door.opening_width_m / 2, abs=0.06)


def test_a_sliding_leaf_moves_to_its_side_along_its_face() -> None:
    for hinge, side in (("left", 1), ("right", -1)):
        for swing, face in (("towards", 1), ("away", -1)):
            door = Door.model_validate(
                {
                    "kind": "sliding",
                    "hinge": hinge,
                    "swing": swing,
                    "leaf_recess_m": -0.07,
                    "stop_width_m": 0.0,
                }
            )
            (leaf,) = bare_leaves(door, Opening(share=0.5))
            assert leaf.center_m[0] == pytest.approx(side * 0.45)
            middle = leaf.center_m[1] + (0.15 if face < 0 else 0.0)
            assert middle == pytest.approx(face * (0.03 + 0.02))
            assert not collide([leaf], [box for box in fixed_boxes(door) if box.part == Part.WALL], 0.0)


@pytest.mark.parametrize(("kind", "panes"), [("single", 0), ("glazed", 1), ("full_glass", 1)])
def test_kinds_have_their_panes(kind: DoorKind, panes: int) -> None:
    door = next(door for door in DOORS if door.kind == kind)
    leaf = bare_leaves(door, Opening())
    glass = [box for box in leaf if box.material == "glass"]
    assert len(glass) == panes
    if glass:
        share = glass[0].size_m[0] * glass[0].size_m[2] / (door.opening_width_m * door.opening_height_m)
        assert share > (0.9 if kind == "full_glass" else 0.15)
        # The pane touches the other parts of the leaf.
        assert collide(glass, [box for box in leaf if box.material != "glass"], -0.001)


@pytest.mark.parametrize("kind", ["lever", "knob", "bar"])
def test_handles_are_fixed_to_both_faces_near_the_free_edge(kind: str) -> None:
    handle = LEVER.model_copy(update={"kind": kind, "length_m": 0.5 if kind == "bar" else 0.13})
    door = Door(hinge="right", handle=handle)
    bare = bare_leaves(door, Opening())
    parts = leaf_boxes(door, Opening())[len(bare) :]
    assert all(collide([part], [*bare, *(p for p in parts if p != part)], -0.001) for part in parts)
    assert span(parts, 1) == pytest.approx((-0.04 - 0.06, 0.06))
    assert span(parts, 0)[1] == pytest.approx(0.447 - 0.065, abs=0.03)
    assert sum(span(parts, 2)) / 2 == pytest.approx(1.0, abs=0.001)
