# SPDX-License-Identifier: Apache-2.0
"""Fixtures fill their outline and nothing outside of it; people and stairs likewise."""

from __future__ import annotations

import math

import numpy as np
import pytest

from doorstate.simulation.scene.box import Box
from doorstate.simulation.scene.capsule import Capsule
from doorstate.simulation.scene.fixture import FIXTURES, Fixture, FixtureKind, fixture_boxes
from doorstate.simulation.scene.person import Person, person_boxes
from doorstate.simulation.scene.plan import collide, footprint
from doorstate.simulation.scene.stairs import Stairs, stairs_boxes
from doorstate.types import Part


def bounds(boxes: list[Box]) -> np.ndarray:
    """Return the low and high corner of boxes, (2, 3)."""
    corners = [
        (*corner, box.center_m[2] + side * box.size_m[2] / 2)
        for box in boxes
        for corner in footprint(box)
        for side in (-1, 1)
    ]
    return np.array([np.min(corners, axis=0), np.max(corners, axis=0)])


@pytest.mark.parametrize("kind", FIXTURES)
def test_a_fixture_fills_its_outline(kind: FixtureKind) -> None:
    depth = 1.2 if kind == "round_column" else 0.4
    fixture = Fixture(
        kind=kind,
        x_m=1.0,
        y_m=2.0,
        yaw_deg=90.0,
        width_m=1.2,
        depth_m=depth,
        bottom_m=0.0,
        top_m=2.0,
        count=4,
    )
    boxes = fixture_boxes(fixture)
    assert len(boxes) >= 1
    low, high = bounds(boxes)
    knob = 0.025 if kind == "cupboard" else 0.0
    # Turned by 90 degrees, the back is on x = 1 and the front at x = 1 - depth.
    assert high[0] == pytest.approx(1.0 if kind not in ("radiator",) else 0.96)
    assert low[0] == pytest.approx(1.0 - depth - knob)
    assert (low[1], high[1]) == pytest.approx(
        (1.4, 2.6), abs=0.2 if kind in ("radiator", "handrail", "panels") else 0.011
    )
    assert high[2] == pytest.approx(2.6 if kind == "round_column" else 2.0, abs=0.01)
    part = Part.WALL if kind in ("column", "round_column") else Part.OTHER
    assert {box.part for box in boxes} == {part}
    for number, box in enumerate(boxes):
        assert kind == "cupboard" or not collide([box], boxes[:number], 1e-6)


def test_a_person_is_built_of_capsules_and_as_tall_as_stated() -> None:
    person = Person(x_m=1.0, y_m=-2.0, yaw_deg=30.0, height_m=1.8, shoulder_m=0.4, stride_m=0.5)
    boxes = person_boxes(person)
    assert all(isinstance(box, Capsule) for box in boxes)
    low, high = bounds(boxes)
    assert (low[2], high[2]) == pytest.approx((0.0, 1.8))
    assert 0.4 < high[0] - low[0] < 0.9
    assert 0.4 < high[1] - low[1] < 0.9
    assert np.mean([box.center_m[:2] for box in boxes], axis=0) == pytest.approx((1.0, -2.0))


@pytest.mark.parametrize("rise", [0.17, -0.17])
def test_steps_rise_one_after_the_other(rise: float) -> None:
    stairs = Stairs(
        x_m=1.0, y_m=1.0, yaw_deg=-90.0, width_m=1.2, going_m=0.28, rise_m=rise, steps=8, landing_m=1.0
    )
    boxes = [box for box in stairs_boxes(stairs) if box.part is Part.OTHER]
    assert len(boxes) == 8
    for number, box in enumerate(boxes, 1):
        assert box.center_m[2] + box.size_m[2] / 2 == pytest.approx(number * rise)
        assert box.center_m[0] == pytest.approx(1.0 + 0.28 * (number - 0.5) + (0.5 if number == 8 else 0.0))
    low, high = bounds(boxes)
    outline = bounds([stairs.outline()])
    np.testing.assert_allclose((low[:2], high[:2]), outline[:, :2], atol=1e-9)


def test_a_balustrade_stands_on_the_side_it_is_asked_for() -> None:
    stairs = Stairs(
        x_m=0.0, y_m=0.0, yaw_deg=0.0, width_m=1.2, going_m=0.28, rise_m=0.17, steps=5, rails=(True, False)
    )
    rails = [box for box in stairs_boxes(stairs) if box.size_m[0] < 0.2]
    assert len(rails) == 10
    assert all(box.center_m[0] == pytest.approx(-0.55) for box in rails)
    assert max(box.center_m[2] + box.size_m[2] / 2 for box in rails) == pytest.approx(5 * 0.17 + 0.9 + 0.17)
    assert math.isclose(stairs.length_m, 1.4)
    down = stairs.model_copy(update={"rise_m": -0.17})
    guard = [box for box in stairs_boxes(down) if box.size_m[0] < 0.08]
    assert len(guard) == 10
    assert all(box.center_m[0] == pytest.approx(-0.65) for box in guard)  # on the floor beside the hole
    assert {round(box.center_m[2], 6) for box in guard} == {0.45, 0.925}
