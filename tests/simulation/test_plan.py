# SPDX-License-Identifier: Apache-2.0
"""Boxes seen from above, against points sampled inside them and on their edges."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.simulation.plan import collide, distance_m, footprint, mirror, place
from doorstate.simulation.scene import Box
from doorstate.types import Part

places = st.floats(-2, 2)
sizes = st.floats(0.1, 2)
boxes = st.builds(
    lambda x, y, z, a, b, c, yaw: Box(Part.OTHER, (x, y, z), (a, b, c), yaw),
    *(places, places, places, sizes, sizes, sizes, st.floats(-4, 4)),
)
GRID = np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 13)] * 3), axis=-1).reshape(-1, 3)


def inside(points: np.ndarray, box: Box, grow_m: float) -> np.ndarray:
    cos, sin = math.cos(box.yaw_rad), math.sin(box.yaw_rad)
    local = (points - np.array(box.center_m)) @ np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    return (np.abs(local) <= np.array(box.size_m) / 2 + grow_m).all(axis=1)


def sampled(box: Box) -> np.ndarray:
    cos, sin = math.cos(box.yaw_rad), math.sin(box.yaw_rad)
    turned = GRID * np.array(box.size_m) @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    return turned + np.array(box.center_m)


@given(one=boxes, other=boxes)
@settings(deadline=None, max_examples=150)
def test_boxes_collide_when_one_holds_a_point_of_the_other(one: Box, other: Box) -> None:
    found = collide([one], [other], 0.0)
    assert found == collide([other], [one], 0.0)
    if inside(sampled(one), other, -1e-6).any() or inside(sampled(other), one, -1e-6).any():
        assert found
    if found:
        # The grid of the larger steps is 0.17 m: whatever overlaps has a grid point that near.
        assert inside(sampled(one), other, 0.3).any()


def test_a_tolerance_lets_boxes_touch_and_slightly_overlap() -> None:
    one = Box(Part.OTHER, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    for overlap_m, expected in ((-0.001, False), (0.004, False), (0.006, True)):
        for axis in range(3):
            center = [0.0, 0.0, 0.0]
            center[axis] = 1 - overlap_m
            assert collide([one], [one._replace(center_m=tuple(center))], 0.005) == expected
    assert not collide([], [one])


@given(one=boxes, other=boxes)
@settings(deadline=None, max_examples=60)
def test_the_distance_is_that_of_the_nearest_edge_points(one: Box, other: Box) -> None:
    steps = np.linspace(0, 1, 80)[:, None]
    edges = []
    for box in (one, other):
        corners = np.array(footprint(box))
        edges.append(
            np.concatenate(
                [a + steps * (b - a) for a, b in zip(corners, np.roll(corners, 1, 0), strict=True)]
            )
        )
    sampled_m = np.linalg.norm(edges[0][:, None] - edges[1][None], axis=-1).min()
    flat = [box._replace(center_m=(*box.center_m[:2], 0.0)) for box in (one, other)]
    found = distance_m(one, other)
    assert found <= sampled_m + 1e-9
    if found:
        assert found == pytest.approx(sampled_m, abs=0.03)
    else:
        assert collide([flat[0]], [flat[1]], 0.0)


def test_placing_turns_before_it_moves_and_mirroring_twice_changes_nothing() -> None:
    box = Box(Part.OTHER, (1.0, 0.0, 0.5), (0.4, 0.2, 1.0), 0.1)
    (placed,) = place([box], 2.0, 3.0, math.pi / 2)
    assert placed.center_m == pytest.approx((2.0, 4.0, 0.5))
    assert placed.yaw_rad == pytest.approx(0.1 + math.pi / 2)
    (reflected,) = mirror([box], x=True, about_y_m=-0.5)
    assert reflected.center_m == (-1.0, -1.0, 0.5)
    assert reflected.yaw_rad == 0.1  # two reflections are half a turn, which no box can tell from none
    assert mirror([reflected], x=True, about_y_m=-0.5) == [box]
    (sideways,) = mirror([box], x=True)
    corners = sorted((-x, y) for x, y in footprint(box))
    np.testing.assert_allclose(sorted(footprint(sideways)), corners, atol=1e-12)
