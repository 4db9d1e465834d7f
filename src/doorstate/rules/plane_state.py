# SPDX-License-Identifier: Apache-2.0
"""Door-sized rectangles among the planes of a cloud: a reconstruction of Rusu et al. 2009, not their code."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from doorstate.doorways.plan_lines import Floats, angle_deg
from doorstate.doorways.planes import Plane, component_numbers, normals, upright_plane, voxel_downsample
from doorstate.rules.base import Parameters, Rule, RuleResult, state_by_angle
from doorstate.rules.walls import (
    WallParameters,
    covered_length_m,
    nearby_points,
    outline,
    state_without_leaf,
)
from doorstate.types import Points


class PlaneStateParameters(Parameters):
    """Sizes of doors, tolerances of planes, limits of the angle."""

    voxel_m: float = 0.04  # chosen: twenty points across a leaf
    # Chosen: range of the Xtion; beyond it noise of stereo cameras exceeds planes' thresholds.
    farthest_m: float = 5.0
    neighbours: int = 12  # of a normal; chosen: a patch of 0.14 m, small against a leaf, large against noise
    tilt_deg: float = 15.0  # of an upright normal; chosen: noise, and a few degrees of the camera's tilt
    heading_bin_deg: float = 4.0  # chosen: finer than the tolerance
    # Chosen: noise of normals, half the smallest semi-open angle of the data.
    heading_tolerance_deg: float = 8.0
    most_planes: int = 6  # chosen: wall, leaf, reveals, and a corridor
    min_points: int = 40  # of a plane; chosen: voxels of 0.06 m2
    # Chosen: wider than a reveal, no wider than a single door.
    leaf_width_m: tuple[float, float] = (0.35, 1.25)
    # Chosen: what a view from 1 m shows, highest of single doors.
    leaf_height_m: tuple[float, float] = (0.8, 2.5)
    # Leaves reach from below to above the camera: no robot looks over or under a door.
    camera_heights_m: tuple[float, float] = (-0.2, 0.2)
    shortest_wall_m: float = 0.25  # chosen: longer than a reveal in a thin wall
    # Leaf to hinge line; chosen: a wall's thickness; it hides the hinge or prolongs the leaf.
    touch_m: float = 0.25
    hinge_m: float = 0.1  # chosen: half of it is frame, the rest rounding of voxels
    # Along the wall from the hinge: within every opening, and beyond where a leaf at 8 degrees is still in its wall.
    opening_m: tuple[float, float] = (0.3, 0.6)
    side_points: int = 5  # on the wall beside the hinge; chosen: more than flying pixels leave
    farthest_wall_m: float = 1.5  # from the hinge; chosen: a door's width and its frame
    flush_m: float = 0.25  # of a closed leaf behind its wall; chosen: thickness of a wall
    view_margin_deg: float = 2.0  # a leaf that ends this near the border of the view may be cut; chosen
    # Chosen: half the smallest semi-open angle of the data, above the fit's error.
    closed_below_deg: float = 8.0
    # Chosen: middle of the gap between semi-open (to 65) and open (from 75) of the data.
    open_above_deg: float = 70.0
    wall: WallParameters = WallParameters()


class _Surface(NamedTuple):
    plane: Plane
    points: Floats  # (N, 3)


class _HungLeaf(NamedTuple):
    """Leaf with the wall that it hangs on."""

    wall: _Surface
    leaf: _Surface
    angle_deg: float
    opening_width_m: float | None
    free_end_in_view: bool
    wall_length_m: float


class PlaneStateRule(Rule[PlaneStateParameters]):
    """Upright planes by their normals; the one of a door's size that hangs on another by one end is the leaf.

    Where the wall continues beside the hinge tells angles below and above 90 degrees apart. Without a leaf:
    `walls.state_without_leaf`.
    """

    name = "plane_state"
    source = "Rusu et al. 2009"
    defaults = PlaneStateParameters

    def __call__(self, cloud: Points) -> RuleResult:
        p = self.parameters
        points, _ = nearby_points(cloud, p.farthest_m)
        if len(points) < p.min_points:
            return RuleResult.abstain("too few points")
        points = voxel_downsample(points, p.voxel_m)
        surfaces = self._surfaces(points)
        if not surfaces:
            return RuleResult.abstain("no upright plane")
        hung_leaves = self._hung_leaves(surfaces, self._view_deg(points))
        if not hung_leaves:
            widest = max(
                surfaces, key=lambda surface: covered_length_m(surface.plane, surface.points, p.wall.bin_m)
            )
            return state_without_leaf(widest.plane, points, p.wall)
        best = max(hung_leaves, key=lambda hung: (hung.free_end_in_view, hung.wall_length_m))
        return RuleResult(
            state_by_angle(best.angle_deg, p.closed_below_deg, p.open_above_deg),
            opening_angle_deg=best.angle_deg,
            opening_width_m=best.opening_width_m,
            detections=(outline("wall", *best.wall), outline("leaf", *best.leaf)),
        )

    def _surfaces(self, points: Floats) -> list[_Surface]:
        """Return planes of points with similar upright normals, those with most normals first."""
        p = self.parameters
        normal, _ = normals(points, p.neighbours)
        upright = np.abs(normal[:, 2]) < math.sin(math.radians(p.tilt_deg))
        points = points[upright]
        heading_deg = np.degrees(np.arctan2(normal[upright, 1], normal[upright, 0])) % 180
        surfaces: list[_Surface] = []
        for _ in range(p.most_planes):
            counts = np.bincount((heading_deg // p.heading_bin_deg).astype(np.int64), minlength=1)
            peak_deg = (float(counts.argmax()) + 0.5) * p.heading_bin_deg
            deviation_deg = np.abs((heading_deg - peak_deg + 90) % 180 - 90)
            similar = np.flatnonzero(deviation_deg <= p.heading_tolerance_deg)
            fit = upright_plane(points[similar], p.wall.threshold_m)
            if fit is None or fit[1].sum() < p.min_points:
                break
            plane, on_plane = fit
            surfaces.append(_Surface(plane, points[similar[on_plane]]))
            points = np.delete(points, similar[on_plane], 0)
            heading_deg = np.delete(heading_deg, similar[on_plane])
        return surfaces

    def _view_deg(self, points: Floats) -> tuple[float, float]:
        """Return the directions of the right and left border of the view, less a margin."""
        bearing_deg = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
        margin_deg = self.parameters.view_margin_deg
        return bearing_deg.min() + margin_deg, bearing_deg.max() - margin_deg

    def _hung_leaves(self, surfaces: list[_Surface], view_deg: tuple[float, float]) -> list[_HungLeaf]:
        """Return every leaf with every wall that it hangs on."""
        leaves = [(number, self._door_sized_part(surface)) for number, surface in enumerate(surfaces)]
        pairs = [
            self._hang(wall, leaf, view_deg)
            for leaf_number, leaf in leaves
            for wall_number, wall in enumerate(surfaces)
            if leaf is not None and wall_number != leaf_number
        ]
        return [pair for pair in pairs if pair is not None]

    def _door_sized_part(self, surface: _Surface) -> _Surface | None:
        """Return the largest connected component, if it is as wide and high as a leaf."""
        p = self.parameters
        largest = component_numbers(surface.points, 3 * p.voxel_m) == 0
        leaf = _Surface(surface.plane, surface.points[largest])
        low, high = leaf.points[:, 2].min(), leaf.points[:, 2].max()
        fits = (
            p.leaf_width_m[0] <= covered_length_m(*leaf, p.wall.bin_m) <= p.leaf_width_m[1]
            and p.leaf_height_m[0] <= high - low <= p.leaf_height_m[1]
            and low < p.camera_heights_m[0]
            and high > p.camera_heights_m[1]
        )
        return leaf if fits else None

    def _hang(self, wall: _Surface, leaf: _Surface, view_deg: tuple[float, float]) -> _HungLeaf | None:
        """Return the pair, if the leaf hangs on the wall by one end or lies flush in it."""
        p = self.parameters
        wall_length_m = covered_length_m(*wall, p.wall.bin_m)
        low, high = leaf.points[:, 2].min(), min(leaf.points[:, 2].max(), p.wall.low_m)
        # (M, 2) points of the wall in plan view at the heights of the leaf.
        beside = wall.points[(wall.points[:, 2] > low) & (wall.points[:, 2] < high), :2]
        if wall_length_m < p.shortest_wall_m or len(beside) == 0:
            return None
        tilt_deg = angle_deg(wall.plane.normal, leaf.plane.normal)
        if tilt_deg < p.closed_below_deg:
            flush = self._is_flush(wall, leaf, wall_length_m, beside)
            return _HungLeaf(wall, leaf, tilt_deg, None, False, wall_length_m) if flush else None
        hinge = np.linalg.solve(
            np.stack([wall.plane.normal[:2], leaf.plane.normal[:2]]),
            np.array([wall.plane.offset_m, leaf.plane.offset_m]),
        )
        outwards = leaf.points[:, :2].mean(axis=0) - hinge
        outwards /= np.linalg.norm(outwards)
        from_hinge_m, to_tip_m = np.quantile((leaf.points[:, :2] - hinge) @ outwards, (0.02, 0.98))
        # The part of the wall's line right at the hinge that is visible lies on the camera's side of the leaf:
        # nothing hides it.
        side = np.array([-wall.plane.normal[1], wall.plane.normal[0]])
        side *= -np.sign(side @ leaf.plane.normal[:2])
        position_m = (beside - hinge) @ side
        if abs(from_hinge_m) > p.touch_m or np.abs(position_m).min() > p.farthest_wall_m:
            return None
        continues = ((position_m > p.hinge_m) & (position_m < p.opening_m[0])).sum() >= p.side_points
        beyond = (-position_m > p.opening_m[0]) & (-position_m < p.opening_m[1])
        if continues and beyond.sum() >= p.side_points:
            return None  # no opening: furniture, a pillar or another room's wall
        if continues:
            opening = -side
        elif _is_in_view(hinge + side * p.hinge_m, view_deg):
            opening = side
        else:  # both are possible: take the smaller angle
            opening = side * np.sign(side @ outwards)
        angle = math.degrees(math.acos(np.clip(outwards @ opening, -1.0, 1.0)))
        across_m = (beside - hinge) @ opening
        gap_m = float(across_m[across_m > p.wall.opening_width_m[0]].min(initial=math.inf))
        width_m = gap_m if gap_m <= p.wall.opening_width_m[1] else None
        tip_in_view = _is_in_view(hinge + outwards * to_tip_m, view_deg)
        return _HungLeaf(wall, leaf, angle, width_m, tip_in_view, wall_length_m)

    def _is_flush(self, wall: _Surface, leaf: _Surface, wall_length_m: float, beside: Floats) -> bool:
        """Return True if a parallel leaf lies in the wall."""
        p = self.parameters
        centre = leaf.points[:, :2].mean(axis=0)
        return bool(
            abs(float(np.median(wall.plane.distances_m(leaf.points)))) <= p.flush_m
            and wall_length_m > covered_length_m(*leaf, p.wall.bin_m)
            and np.linalg.norm(beside - centre, axis=1).min() <= p.farthest_wall_m
        )


def _is_in_view(place: Floats, view_deg: tuple[float, float]) -> bool:
    return view_deg[0] < math.degrees(math.atan2(place[1], place[0])) < view_deg[1]
