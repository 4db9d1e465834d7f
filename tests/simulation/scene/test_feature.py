# SPDX-License-Identifier: Apache-2.0
"""Walls without a door: every drawn feature keeps the rule that sets it apart from a door (docs/data-card.md)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.simulation.scene import Box
from doorstate.simulation.scene.feature import FEATURES, Feature, feature_boxes
from doorstate.types import Part

SCENES = [draw_rows(PRESETS["no-door"], 0, index)[0].scene for index in range(300)]


def features(kind: str) -> Iterator[tuple[Feature, list[Box]]]:
    for scene in SCENES:
        if scene.feature is not None and scene.feature.kind == kind:
            yield scene.feature, feature_boxes(scene.feature)


def solid(boxes: list[Box], x: np.ndarray, y: float, z: np.ndarray) -> np.ndarray:
    """Return the mask (X, Z) of grid points at depth y that lie in a box."""
    grid = np.stack(np.meshgrid(x, [y], z, indexing="ij"), axis=-1)[:, 0]
    assert all(box.yaw_rad == 0 for box in boxes)
    inside = [(np.abs(grid - box.center_m) <= np.array(box.size_m) / 2).all(axis=-1) for box in boxes]
    return np.any(inside, axis=0)


def across(low: float, high: float) -> np.ndarray:
    """Return 40 coordinates from low to high, just inside the ends."""
    return np.linspace(low + 1e-6, high - 1e-6, 40)


@pytest.mark.parametrize("kind", FEATURES)
def test_features_have_neither_leaf_nor_frame(kind: str) -> None:
    drawn = list(features(kind))
    assert len(drawn) > 20
    assert not any({Part.LEAF, Part.FRAME} & {box.part for box in boxes} for _, boxes in drawn)


def test_a_plain_wall_is_solid() -> None:
    for feature, boxes in features("wall"):
        assert len(boxes) == 1
        assert solid(boxes, across(-3, 3), -feature.wall_thickness_m / 2, across(0, 2.3)).all()


@pytest.mark.parametrize("kind", ["inner_corner", "outer_corner"])
def test_the_wall_before_a_corner_is_solid(kind: str) -> None:
    for feature, boxes in features(kind):
        corner, thickness = feature.corner_m, feature.wall_thickness_m
        assert 0.25 <= abs(corner) <= 1.0
        side = 1.0 if corner > 0 else -1.0
        before, beyond = sorted((corner, -3 * side)), sorted((corner + 0.31 * side, corner + 2 * side))
        assert solid(boxes, across(*before), -thickness / 2, across(0, 2.3)).all()
        assert not solid(boxes, across(*beyond), -thickness / 2, across(0, 2.3)).any()
        # The second wall: beyond the corner towards the robot, or before it away from the robot.
        inner = kind == "inner_corner"
        second = sorted((corner, corner + (side if inner else -side) * thickness))
        assert solid(boxes, across(*second), 1.0 if inner else -1.0, across(0, 2.3)).all()
        assert not solid(boxes, across(*second), -1.0 if inner else 1.0, across(0, 2.3)).any()


def test_a_cupboard_projects_from_a_solid_wall() -> None:
    for feature, boxes in features("cupboard"):
        walls = [box for box in boxes if box.part == Part.WALL]
        half = feature.width_m / 2
        assert solid(walls, across(-half, half), -feature.wall_thickness_m / 2, across(0, 2.3)).all()
        assert 0.30 <= feature.depth_m <= 0.60
        front = [box for box in boxes if box.part == Part.OTHER]
        behind_the_face = feature.depth_m - 0.001
        covered = solid(front, across(-half, half), behind_the_face, across(0.1, feature.top_m - 0.01))
        assert covered.mean() > 0.9  # except for the gaps between fronts


def test_the_wall_below_a_window_is_half_a_metre_high() -> None:
    for feature, boxes in features("window"):
        half = feature.width_m / 2
        assert feature.bottom_m >= 0.5
        below = solid(boxes, across(-half, half), -feature.wall_thickness_m / 2, across(0, feature.bottom_m))
        assert below.all()


def test_a_niche_has_a_solid_back() -> None:
    for feature, boxes in features("niche"):
        half, height = feature.width_m / 2, across(feature.bottom_m, feature.top_m)
        assert 0.15 <= feature.depth_m <= 0.60
        assert not solid(boxes, across(-half, half), -feature.depth_m / 2, height).any()
        assert solid(boxes, across(-half, half), -feature.depth_m - 0.001, height).all()


def test_a_passage_is_open_from_the_floor_up() -> None:
    for feature, boxes in features("passage"):
        half = feature.width_m / 2
        assert feature.width_m >= 0.8
        assert feature.top_m >= 2.0
        for depth in (0.001, feature.wall_thickness_m / 2, feature.wall_thickness_m - 0.001):
            assert not solid(boxes, across(-half, half), -depth, across(0, feature.top_m)).any()
