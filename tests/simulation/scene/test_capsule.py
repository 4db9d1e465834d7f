# SPDX-License-Identifier: Apache-2.0
"""Capsules: depth and incidence against plain mathematics, motions, and sizes that are refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.io.camera import Intrinsics
from doorstate.simulation.camera import CameraPose
from doorstate.simulation.render import NO_BOX, incidence, render
from doorstate.simulation.scene.box import Box, mirror, place
from doorstate.simulation.scene.capsule import Capsule, capsule
from doorstate.types import Part
from tests.simulation import naive_caster

CAMERA = Intrinsics.from_hfov(18, 14, math.radians(70))
Vector = tuple[float, float, float]


def distance_to_axis(shape: Capsule, point: Vector) -> tuple[float, Vector]:
    """Return the distance of a point from the segment within a capsule, and the direction from there."""
    x, y, z = shape.center_m
    reach = (shape.size_m[2] - shape.size_m[0]) / 2
    nearest = (x, y, min(max(point[2], z - reach), z + reach))
    away = tuple(a - b for a, b in zip(point, nearest, strict=True))
    length = math.hypot(*away)
    return length, (away[0] / length, away[1] / length, away[2] / length)


def march(shape: Capsule, origin: Vector, ray: Vector) -> float:
    """Return the z-depth at which a ray enters a capsule by sphere tracing (Hart 1996), infinite if it misses."""
    depth, length = 0.0, math.hypot(*ray)
    for _ in range(2000):
        point = (origin[0] + depth * ray[0], origin[1] + depth * ray[1], origin[2] + depth * ray[2])
        gap = distance_to_axis(shape, point)[0] - shape.size_m[0] / 2
        if gap < 1e-10:
            return depth
        depth += gap / length
        if depth > 60:
            return math.inf
    return depth


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=12, deadline=None)
def test_depth_and_incidence_are_those_of_sphere_tracing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    radius = float(rng.uniform(0.05, 0.6))
    low = float(rng.uniform(-2, 1))
    shape = capsule(
        Part.OTHER, *rng.uniform(-1, 1, 2), (low, low + 2 * radius + float(rng.uniform(0, 2))), radius
    )
    yaw, pitch, roll = rng.uniform(-1, 1, 3).tolist()
    pose = CameraPose(
        -3.0 * math.cos(yaw), -3.0 * math.sin(yaw), float(rng.uniform(-1, 3)), yaw, pitch, roll / 5
    )
    rendered = render([shape], pose, CAMERA)
    angles = incidence(rendered, [shape], pose, CAMERA)
    for row in range(CAMERA.height):
        for column in range(CAMERA.width):
            ray = naive_caster.pixel_ray(row, column, pose, CAMERA)
            expected = march(shape, pose[:3], ray)
            if math.isinf(expected):
                assert rendered.box[row, column] == NO_BOX
                continue
            assert rendered.depth_m[row, column] == pytest.approx(expected, abs=1e-4)
            point = tuple(a + expected * b for a, b in zip(pose[:3], ray, strict=True))
            normal = distance_to_axis(shape, point)[1]
            cosine = abs(sum(a * b for a, b in zip(normal, ray, strict=True))) / math.hypot(*ray)
            # Depth of a grazing ray is known to 1e-10 only where tracing stops.
            if cosine > 0.05:
                assert math.cos(angles[row, column]) == pytest.approx(cosine, abs=1e-3)


def test_the_nearer_of_a_capsule_and_a_box_is_seen() -> None:
    shape = capsule(Part.OTHER, 2.0, 0.0, (-1.0, 1.0), 0.4)
    wall, pane = (
        Box(Part.WALL, (3.5, 0.0, 0.0), (1.0, 9.0, 9.0)),
        Box(Part.LEAF, (1.0, 0.0, 0.0), (0.1, 0.1, 0.1)),
    )
    rendered = render(
        [wall, shape, pane], CameraPose(0, 0, 0, 0), Intrinsics.from_hfov(31, 21, math.radians(60))
    )
    assert rendered.box[10, 15] == 2
    assert rendered.box[10, 0] == 0
    assert set(np.unique(rendered.box)) == {0, 1, 2}


def test_moved_and_mirrored_capsules_stay_capsules() -> None:
    shape = capsule(Part.OTHER, 1.0, 0.0, (0.0, 2.0), 0.2, "dark")
    (moved,) = mirror(place([shape], 0.0, 1.0, math.pi / 2), x=True)
    assert isinstance(moved, Capsule)
    assert moved.center_m == pytest.approx((0.0, 2.0, 1.0))
    assert (moved.size_m, moved.material) == ((0.4, 0.4, 2.0), "dark")


@pytest.mark.parametrize("ends_m", [(0.0, 0.3), (1.0, 0.0)])
def test_a_capsule_is_at_least_as_high_as_wide(ends_m: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="radius"):
        capsule(Part.OTHER, 0.0, 0.0, ends_m, 0.2)
