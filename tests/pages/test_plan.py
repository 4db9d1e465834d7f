# SPDX-License-Identifier: Apache-2.0
"""Plans: walls end at openings, leaves hang on their hinges, and drawings in SVG and characters show both."""

from __future__ import annotations

import math
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.inference.abstention import Abstention
from doorstate.inference.door import Door
from doorstate.inference.prediction import Prediction
from doorstate.inference.serialization import prediction_to_dict
from doorstate.pages.plan import Plan, make_plan, plan_of_record, plan_walls
from doorstate.pages.plan_svg import plan_svg
from doorstate.pages.plan_text import SIGN_WIDTH, ascii_only, door_sign, plan_text
from doorstate.types import STATES, DoorState

SVG = "{http://www.w3.org/2000/svg}"
WALL = ((3.0, 2.0), (3.0, -2.0))


def door(y_m: float = 0.0, angle_deg: float | None = 90.0, state: str | None = "open", **fields: Any) -> Door:
    values: dict[str, Any] = {"hinge": "left", "opening_angle_deg": angle_deg} | fields
    return Door(3.0, y_m, 90.0, 0.8, None if state is None else DoorState(state), **values)


def plan_of(*doors: Door, **options: Any) -> Plan:
    return make_plan(Prediction.from_doors(doors, [], 1, 1.0), **options)


def lengths_m(plan: Plan) -> list[float]:
    return sorted(round(math.dist(start, end), 6) for start, end in plan.walls)


def test_a_wall_ends_at_the_openings_in_it() -> None:
    assert lengths_m(plan_of(door(), walls=[WALL])) == [1.6, 1.6]
    assert lengths_m(plan_of(door(1.0), door(-1.0), walls=[WALL])) == [0.6, 0.6, 1.2]
    beside = ((1.0, 2.0), (1.0, -2.0))
    assert 4.0 in lengths_m(plan_of(door(), walls=[beside])), "another wall has no opening"


def test_a_door_without_a_wall_gets_a_piece_on_both_sides() -> None:
    plan = plan_of(door())
    assert lengths_m(plan) == [0.45, 0.45]
    assert {x for segment in plan.walls for x, _ in segment} == {3.0}


def test_walls_that_are_the_leaf_or_far_away_are_left_out() -> None:
    leaf = ((2.95, 0.38), (2.25, 0.36))
    far = ((30.0, 1.0), (30.0, -1.0))
    assert lengths_m(plan_of(door(), walls=[WALL, leaf, far])) == [1.6, 1.6]
    assert len(plan_of(door(state="closed", angle_deg=0.0), walls=[WALL, leaf]).walls) == 3


def test_the_leaf_turns_about_its_hinge() -> None:
    (open_door,) = plan_of(door()).doors
    assert open_door.hinge_m == pytest.approx((3.0, 0.4))
    assert open_door.tip_m == pytest.approx((2.2, 0.4))
    assert open_door.swing_m[0] == pytest.approx((3.0, -0.4))
    assert open_door.outward == pytest.approx((1.0, 0.0))
    (unknown,) = plan_of(door(state=None, abstention=Abstention("no_door"))).doors
    assert (unknown.state, unknown.hinge_m) == ("abstained", None)


def test_doors_are_numbered_or_named() -> None:
    assert [one.label for one in plan_of(door(1.0), door(-1.0)).doors] == ["1", "2"]
    assert [one.label for one in plan_of(door()).doors] == [""]
    named = plan_of(door(1.0), door(-1.0), names=["kitchen", None])
    assert [one.label for one in named.doors] == ["kitchen", "?"]


def test_the_record_of_a_prediction_gives_its_plan() -> None:
    prediction = Prediction.from_doors([door(1.0), door(-1.0, state="closed", angle_deg=None)], [], 1, 1.0)
    assert plan_of_record(prediction_to_dict(prediction)["doors"]) == make_plan(prediction)
    assert plan_of_record([]).doors == ()


def test_walls_are_found_with_their_holes() -> None:
    y, z = (axis.ravel() for axis in np.meshgrid(np.arange(-2, 2, 0.02), np.arange(-1.0, 1.4, 0.05)))
    keep = np.abs(y - 0.2) > 0.45
    points = np.stack([np.full(keep.sum(), 3.0), y[keep], z[keep]], axis=1).astype(np.float32)
    walls = plan_walls(points, -1.0)
    assert sorted(round(math.dist(*wall), 1) for wall in walls) == [1.3, 1.7]
    assert plan_walls(points[:0], -1.0) == []


def test_the_picture_has_walls_leaf_and_distance_and_escapes_names() -> None:
    plan = plan_of(door(), names=["<b>&"], walls=[WALL], view_deg=(-30.0, 30.0))
    root = ElementTree.fromstring(plan_svg(plan, "a & b.pcd"))
    lines = [line.get("class") for line in root.iter(f"{SVG}line")]
    assert lines.count("wall") == 2
    texts = ["".join(text.itertext()) for text in root.iter(f"{SVG}text")]
    assert {"<b>&", "open 90°", "3.00 m", "1 m", "a & b.pcd"} <= set(texts)
    polygons = [polygon.get("class") for polygon in root.iter(f"{SVG}polygon")]
    assert {"view", "robot"} <= set(polygons)


places = st.tuples(st.floats(0.3, 6), st.floats(-4, 4), st.floats(-180, 180), st.floats(0.4, 2.0))


@settings(max_examples=30)
@given(st.lists(places, max_size=5), st.text(max_size=15))
def test_any_doors_can_be_drawn_inside_of_the_drawing(
    doors: list[tuple[float, float, float, float]], name: str
) -> None:
    shown = [
        Door(*place, state=DoorState(STATES[number % 3]), hinge="right", opening_angle_deg=40.0 * number)
        for number, place in enumerate(doors)
    ]
    plan = plan_of(*shown, names=[name] * len(shown))
    drawing = plan_text(plan)
    assert 1 <= len(drawing.lines) <= 12
    assert {len(line) for line in drawing.lines} == {34}
    for mark in drawing.marks:
        assert 0 <= mark.row < len(drawing.lines)
        assert 0 <= mark.column <= mark.column + mark.length <= 34
    root = ElementTree.fromstring(plan_svg(plan))
    width, height = (float(root.get(side, "0")) for side in ("width", "height"))
    for line in root.iter(f"{SVG}line"):
        assert all(-1 <= float(line.get(end, "nan")) <= width + 1 for end in ("x1", "x2"))
        assert all(-1 <= float(line.get(end, "nan")) <= height + 1 for end in ("y1", "y2"))


def test_a_drawing_shows_a_closed_door_between_its_jambs() -> None:
    drawing = plan_text(plan_of(door(state="closed", angle_deg=0.0)))
    assert drawing.lines[-1].strip() == "▲"
    assert {mark.door for mark in drawing.marks} == {0}
    top = "".join(drawing.lines[:2])
    assert sum("\u2800" < character <= "\u28ff" for character in top) >= 14


def test_a_sign_has_one_width_and_tells_the_states_apart() -> None:
    signs = {door_sign(state, hinge) for state in (*STATES, None) for hinge in (None, "left", "right")}
    assert {len(sign) for sign in signs} == {SIGN_WIDTH}
    assert len({door_sign(state, "left") for state in (*STATES, None)}) == 4
    assert all(ascii_only(sign).isascii() and len(ascii_only(sign)) == SIGN_WIDTH for sign in signs)
