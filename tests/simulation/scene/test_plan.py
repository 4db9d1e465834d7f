# SPDX-License-Identifier: Apache-2.0
"""Collisions and distances of boxes, against points sampled inside them and on their edges."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.simulation.scene import Box
from doorstate.simulation.scene.box import mirror, place
from doorstate.simulation.scene.plan import collide, distance_m, footprint
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


@given(first=boxes, second=boxes)
@settings(max_examples=150)
def test_boxes_collide_if_one_contains_a_point_of_the_other(first: Box, second: Box) -> None:
    overlap = collide([first], [second], 0.0)
    assert overlap == collide([second], [first], 0.0)
    if inside(sampled(first), second, -1e-6).any() or inside(sampled(second), first, -1e-6).any():
        assert overlap
    if overlap:
        # The coarser grid has steps of 0.17 m, so overlapping boxes have a grid point within 0.3 m.
        assert inside(sampled(first), second, 0.3).any()


def test_a_tolerance_lets_boxes_touch_and_slightly_overlap() -> None:
    first = Box(Part.OTHER, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    for overlap_m, expected in ((-0.001, False), (0.004, False), (0.006, True)):
        for axis in range(3):
            center = [0.0, 0.0, 0.0]
            center[axis] = 1 - overlap_m
            assert collide([first], [first._replace(center_m=tuple(center))], 0.005) == expected
    assert not collide([], [first])


@given(first=boxes, second=boxes)
@settings(max_examples=60)
def test_the_distance_is_that_of_the_nearest_edge_points(first: Box, second: Box) -> None:
    steps = np.linspace(0, 1, 80)[:, None]
    edges = []
    for box in (first, second):
        corners = np.array(footprint(box))
        edges.append(
            np.concatenate(
                [a + steps * (b - a) for a, b in zip(corners, np.roll(corners, 1, 0), strict=True)]
            )
        )
    sampled_m = np.linalg.norm(edges[0][:, None] - edges[1][None], axis=-1).min()
    flat = [box._replace(center_m=(*box.center_m[:2], 0.0)) for box in (first, second)]
    distance = distance_m(first, second)
    assert distance <= sampled_m + 1e-9
    if distance:
        assert distance == pytest.approx(sampled_m, abs=0.03)
    else:
        assert collide([flat[0]], [flat[1]], 0.0)


def test_place_rotates_before_it_translates_and_two_mirrors_cancel() -> None:
    box = Box(Part.OTHER, (1.0, 0.0, 0.5), (0.4, 0.2, 1.0), 0.1)
    (placed,) = place([box], 2.0, 3.0, math.pi / 2)
    assert placed.center_m == pytest.approx((2.0, 4.0, 0.5))
    assert placed.yaw_rad == pytest.approx(0.1 + math.pi / 2)
    (reflected,) = mirror([box], x=True, about_y_m=-0.5)
    assert reflected.center_m == (-1.0, -1.0, 0.5)
    assert reflected.yaw_rad == 0.1  # two reflections are half a turn, which leaves a box unchanged
    assert mirror([reflected], x=True, about_y_m=-0.5) == [box]
    (sideways,) = mirror([box], x=True)
    corners = sorted((-x, y) for x, y in footprint(box))
    np.testing.assert_allclose(sorted(footprint(sideways)), corners, atol=1e-12)
