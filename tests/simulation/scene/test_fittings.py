# SPDX-License-Identifier: Apache-2.0
"""Fittings: on their faces, inside of their leaf, and panes that a leaf has a hole for."""

from __future__ import annotations

import pytest

from doorstate.simulation.scene import Box, Door, Opening
from doorstate.simulation.scene.clearance import free_angle_deg
from doorstate.simulation.scene.door_boxes import leaf_boxes
from doorstate.simulation.scene.fittings import Fitting, FittingKind
from doorstate.simulation.scene.plan import collide
from doorstate.types import Part
from tests.simulation.scene.doors import span

PANEL = Fitting(kind="vision_panel", middle_m=1.4, width_m=0.2, height_m=0.8, free_edge_m=0.15)
BAR = Fitting(kind="push_bar", middle_m=1.0, width_m=0.7, height_m=0.06)


def closed(*fittings: Fitting, **values: object) -> list[Box]:
    door = Door(hinge="right", hinge_offset_m=0.01).model_copy(update={"fittings": fittings, **values})
    return leaf_boxes(door, Opening())


def area_m2(boxes: list[Box]) -> float:
    return sum(box.size_m[0] * box.size_m[2] for box in boxes)


def test_a_vision_panel_is_a_pane_in_a_hole_of_its_leaf() -> None:
    boxes = closed(PANEL)
    (pane,) = (box for box in boxes if box.material == "glass")
    assert span([pane], 0) == pytest.approx((0.447 - 0.15 - 0.2, 0.447 - 0.15))
    assert span([pane], 2) == pytest.approx((1.0, 1.8))
    wood = [box for box in boxes if box != pane]
    assert not collide([pane], wood, 1e-9)
    (slab,) = closed()
    assert area_m2(boxes) == pytest.approx(area_m2([slab]))
    for axis in range(3):
        assert span(wood, axis) == pytest.approx(span([slab], axis))


def test_a_panel_larger_than_its_leaf_leaves_a_rim() -> None:
    boxes = closed(PANEL.model_copy(update={"width_m": 3.0, "height_m": 9.0}))
    assert min(min(box.size_m) for box in boxes) > 0
    assert area_m2(boxes) == pytest.approx(area_m2(closed()))


@pytest.mark.parametrize(
    ("kind", "faces"),
    [("letter_slot", 2), ("kick_plate", 2), ("viewer", 2), ("push_plate", 1), ("push_bar", 1)],
)
def test_metal_lies_on_the_faces_of_the_leaf(kind: FittingKind, faces: int) -> None:
    (slab,) = closed()
    boxes = closed(Fitting(kind=kind, middle_m=1.0, width_m=0.3, height_m=0.05))[1:]
    assert len(boxes) == (3 if kind == "push_bar" else faces)
    assert {(box.part, box.material) for box in boxes} == {(Part.LEAF, "gloss")}
    assert all(collide([box], [slab, *boxes[:-1]], -0.001) for box in boxes)
    assert not collide(boxes, [slab], 1e-9)
    assert span(boxes, 0) == pytest.approx((-0.15, 0.15))
    if faces == 1:  # on the face that is pushed, away from the side the leaf swings out to
        assert span(boxes, 1)[1] == pytest.approx(span([slab], 1)[0])


def test_a_wide_plate_ends_before_the_stop() -> None:
    plate = Fitting(kind="kick_plate", middle_m=0.15, width_m=2.0, height_m=0.25)
    assert span(closed(plate)[1:], 0) == pytest.approx((-0.447 + 0.015, 0.447 - 0.015))
    assert free_angle_deg(Door(hinge_offset_m=0.0125, fittings=(plate, BAR, PANEL)), []) >= 90


def test_both_leaves_have_the_fittings() -> None:
    boxes = closed(PANEL, kind="double_equal", opening_width_m=1.6, active_share=0.5)
    panes = sorted(span([box], 0) for box in boxes if box.material == "glass")
    assert len(panes) == 2
    assert panes[0] == pytest.approx((-panes[1][1], -panes[1][0]))  # the meeting edges are in the middle


def test_a_leaf_is_of_its_material_and_its_panes_are_not() -> None:
    for kind in ("single", "glazed", "full_glass", "sliding"):
        boxes = closed(kind=kind, leaf_material="dark")
        assert {box.material for box in boxes} <= {"dark", "glass"}
        assert "dark" in {box.material for box in boxes}


def test_doors_without_fittings_have_the_json_they_had() -> None:
    fields = Door().model_dump(exclude_none=True)
    assert not {"leaf_material", "fittings", "panels", "glass_panels"} & {*fields}
