# SPDX-License-Identifier: Apache-2.0
"""The door's boxes: what a tape measure and a protractor would say."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from doorstate.simulation.scene import Box, Door, Hinge, Swing, build_scene
from doorstate.types import Part

hinges: st.SearchStrategy[Hinge] = st.sampled_from(("left", "right"))
swings: st.SearchStrategy[Swing] = st.sampled_from(("away", "towards"))


def leaf_of(door: Door, angle_rad: float) -> Box:
    (leaf,) = (box for box in build_scene(door, angle_rad) if box.part == Part.LEAF)
    return leaf


def edge(leaf: Box, x_sign: float, y_sign: float) -> np.ndarray:
    """A vertical edge of the leaf, seen from above."""
    x, y = x_sign * leaf.size_m[0] / 2, y_sign * leaf.size_m[1] / 2
    cos, sin = math.cos(leaf.yaw_rad), math.sin(leaf.yaw_rad)
    return np.array([leaf.center_m[0] + x * cos - y * sin, leaf.center_m[1] + x * sin + y * cos])


@given(
    hinge=hinges,
    swing=swings,
    angle=st.floats(0, math.pi),
    width=st.floats(0.6, 1.2),
    wall=st.floats(0.08, 0.3),
)
@settings(deadline=None, max_examples=60)
def test_the_leaf_turns_about_a_hinge_that_stays(
    hinge: Hinge, swing: Swing, angle: float, width: float, wall: float
) -> None:
    door = Door(hinge=hinge, swing=swing, opening_width_m=width, wall_thickness_m=wall)
    side, face = (1 if hinge == "left" else -1), (-1 if swing == "away" else 1)
    leaf = leaf_of(door, angle)
    hinge_m = np.array([side * (width / 2 - 0.003), -wall if swing == "away" else 0.0])
    np.testing.assert_allclose(edge(leaf, side, face), hinge_m, atol=1e-12)
    free = edge(leaf, -side, face) - hinge_m
    # The free edge goes from across the opening to the side that the door swings to.
    expected = (width - 0.006) * np.array([-side * math.cos(angle), face * math.sin(angle)])
    np.testing.assert_allclose(free, expected, atol=1e-12)


@pytest.mark.parametrize("hinge", ["left", "right"])
@pytest.mark.parametrize("swing", ["away", "towards"])
def test_a_closed_leaf_fills_the_opening_but_for_its_gaps(hinge: Hinge, swing: Swing) -> None:
    leaf = leaf_of(Door(hinge=hinge, swing=swing), 0.0)
    assert leaf.size_m == pytest.approx((0.894, 0.04, 2.091))
    assert leaf.center_m == pytest.approx((0.0, -0.02 if swing == "towards" else -0.13, 0.006 + 2.091 / 2))


def test_the_wall_leaves_exactly_the_opening_and_its_jambs() -> None:
    door = Door(opening_width_m=1.0, opening_height_m=2.0)
    walls = [box for box in build_scene(door, 0.0) if box.part == Part.WALL]
    spans = sorted(
        (box.center_m[0] - box.size_m[0] / 2, box.center_m[0] + box.size_m[0] / 2) for box in walls
    )
    np.testing.assert_allclose(spans, [(-6, -0.53), (-0.53, 0.53), (0.53, 6)])
    lintel = next(box for box in walls if box.center_m[0] == 0)
    assert lintel.center_m[2] - lintel.size_m[2] / 2 == pytest.approx(2.03)
    assert {box.center_m[1] + box.size_m[1] / 2 for box in walls} == {0.0}  # the robot's face


def test_no_part_of_the_frame_stands_in_the_opening_but_the_stop() -> None:
    door = Door()
    for box in build_scene(door, 0.0):
        if box.part != Part.FRAME:
            continue
        inner_x = abs(box.center_m[0]) - box.size_m[0] / 2
        is_post = box.center_m[0] != 0
        low_z = box.center_m[2] - box.size_m[2] / 2
        reach = inner_x - door.opening_width_m / 2 if is_post else low_z - door.opening_height_m
        assert reach == pytest.approx(0) or reach == pytest.approx(-door.stop_width_m)


def test_a_misspelt_size_is_refused() -> None:
    with pytest.raises(ValidationError, match="opening_widht_m"):
        Door.model_validate({"opening_widht_m": 0.9})
