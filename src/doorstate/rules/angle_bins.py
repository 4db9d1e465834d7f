# SPDX-License-Identifier: Apache-2.0
"""Angle between leaf and wall in bins: the usual method on robots, reconstructed without its authors' code."""

from __future__ import annotations

import numpy as np

from doorstate.doorways.plan_lines import Floats, angle_deg
from doorstate.doorways.planes import Plane, component_numbers, upright_plane, voxel_downsample
from doorstate.rules.base import Parameters, Rule, RuleResult, state_by_angle
from doorstate.rules.walls import (
    WallParameters,
    above_floor,
    covered_length_m,
    nearby_points,
    outline,
    state_without_leaf,
)
from doorstate.types import Points


class AngleBinsParameters(Parameters):
    """Bins of the angle, sizes of a leaf, and least data."""

    closed_below_deg: float = 15.0  # Satya1998-debug/door_navigation, 2026
    open_above_deg: float = 60.0  # the same
    # Chosen: range of the Xtion; beyond it noise of stereo cameras exceeds planes' thresholds.
    farthest_m: float = 5.0
    voxel_m: float = 0.04  # chosen: twenty points across a leaf
    most_planes: int = 5  # chosen: wall, leaf, and three others
    # Chosen: wider than a reveal, no wider than a single door.
    leaf_width_m: tuple[float, float] = (0.3, 1.25)
    touch_m: float = 0.2  # leaf to wall; chosen: thickness of a wall that hides the hinge
    min_leaf_points: int = 60  # chosen: voxels of 0.1 m2
    min_measured_share: float = 0.3  # of the pixels; chosen: stereo cameras indoors measure half and more
    wall: WallParameters = WallParameters()


class AngleBinsRule(Rule[AngleBinsParameters]):
    """Closed below 15 degrees between the planes of leaf and wall, semi-open up to 60, open above.

    Plain on purpose: the angle between two planes ends at 90 degrees, so 130 is reported as 50. Without a leaf:
    `walls.state_without_leaf`.
    """

    name = "angle_bins"
    source = "plain baseline: usual on robots today"
    defaults = AngleBinsParameters

    def __call__(self, cloud: Points) -> RuleResult:
        p = self.parameters
        points, measured_share = nearby_points(cloud, p.farthest_m)
        if measured_share < p.min_measured_share:
            return RuleResult.abstain("too few pixels were measured")
        if len(points) < p.min_leaf_points:
            return RuleResult.abstain("too few points")
        points = voxel_downsample(points, p.voxel_m)
        planes = self._planes(points[above_floor(points, p.wall.floor_margin_m)])
        if not planes:
            return RuleResult.abstain("no vertical plane")
        # By covered length, because a thin slanting cut through clutter is wide but full of holes.
        planes.sort(key=lambda surface: -covered_length_m(surface[0], surface[1], p.wall.bin_m))
        wall, on_wall = planes[0]
        for leaf, on_leaf in planes[1:]:
            on_leaf = on_leaf[component_numbers(on_leaf, 3 * p.voxel_m) == 0]
            narrow = p.leaf_width_m[0] <= covered_length_m(leaf, on_leaf, p.wall.bin_m) <= p.leaf_width_m[1]
            touches = float(np.abs(wall.distances_m(on_leaf)).min()) <= p.touch_m
            if narrow and touches and len(on_leaf) >= p.min_leaf_points:
                angle = angle_deg(wall.normal, leaf.normal)
                detections = (outline("wall", wall, on_wall), outline("leaf", leaf, on_leaf))
                state = state_by_angle(angle, p.closed_below_deg, p.open_above_deg)
                return RuleResult(state, opening_angle_deg=angle, detections=detections)
        return state_without_leaf(wall, points, p.wall)

    def _planes(self, points: Floats) -> list[tuple[Plane, Floats]]:
        planes: list[tuple[Plane, Floats]] = []
        while len(planes) < self.parameters.most_planes:
            fit = upright_plane(points, self.parameters.wall.threshold_m)
            if fit is None or fit[1].sum() < self.parameters.min_leaf_points:
                break
            plane, on_plane = fit
            planes.append((plane, points[on_plane]))
            points = points[~on_plane]
        return planes
