# SPDX-License-Identifier: Apache-2.0
"""Door-like rectangles among the planes of a cloud (Rusu et al. 2009), rebuilt from what is known, not their code."""

from __future__ import annotations

import math
from typing import ClassVar, NamedTuple

import numpy as np

from doorstate.rules.base import Parameters, Rule, RuleResult, state_by_angle
from doorstate.rules.plan_lines import Floats, angle_deg
from doorstate.rules.planes import Plane, normals, pieces, thin, upright_plane
from doorstate.rules.walls import WallParameters, covered_m, nearby, outline, wall_alone
from doorstate.types import Points


class PlaneStateParameters(Parameters):
    """Sizes of doors, tolerances of planes, bins of the angle."""

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


class _Pair(NamedTuple):
    """A leaf and the wall it hangs on."""

    wall: _Surface
    leaf: _Surface
    angle_deg: float
    opening_width_m: float | None
    whole: bool  # its free end is in view
    wall_m: float


class PlaneStateRule(Rule[PlaneStateParameters]):
    """Upright planes by their normals; the one of a door's size that hangs on another by one end is the leaf.

    The angle is told on both sides of perpendicular by where the wall goes on beside the hinge. Without a leaf:
    `walls.wall_alone`.
    """

    name: ClassVar[str] = "plane_state"
    source: ClassVar[str] = "Rusu et al. 2009"
    defaults: ClassVar[type[Parameters]] = PlaneStateParameters

    def __call__(self, cloud: Points) -> RuleResult:
        p = self.parameters
        points, _ = nearby(cloud, p.farthest_m)
        if len(points) < p.min_points:
            return RuleResult.abstain("too few points")
        points = thin(points, p.voxel_m)
        surfaces = self._surfaces(points)
        if not surfaces:
            return RuleResult.abstain("no upright plane")
        bearing = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
        view = (bearing.min() + p.view_margin_deg, bearing.max() - p.view_margin_deg)
        leaves = [(number, leaf) for number, each in enumerate(surfaces) if (leaf := self._rectangle(each))]
        pairs = [
            pair
            for number, leaf in leaves
            for other, wall in enumerate(surfaces)
            if other != number and (pair := self._hang(wall, leaf, view))
        ]
        if not pairs:
            widest = max(surfaces, key=lambda each: covered_m(each.plane, each.points, p.wall.bin_m))
            return wall_alone(widest.plane, points, p.wall)
        best = max(pairs, key=lambda pair: (pair.whole, pair.wall_m))
        return RuleResult(
            state_by_angle(best.angle_deg, p.closed_below_deg, p.open_above_deg),
            opening_angle_deg=best.angle_deg,
            opening_width_m=best.opening_width_m,
            detections=(outline("wall", *best.wall), outline("leaf", *best.leaf)),
        )

    def _surfaces(self, points: Floats) -> list[_Surface]:
        """Planes of points with similar upright normals, those with most normals first."""
        p = self.parameters
        normal, _ = normals(points, p.neighbours)
        upright = np.abs(normal[:, 2]) < math.sin(math.radians(p.tilt_deg))
        points = points[upright]
        heading = np.degrees(np.arctan2(normal[upright, 1], normal[upright, 0])) % 180
        found: list[_Surface] = []
        for _ in range(p.most_planes):
            counts = np.bincount((heading // p.heading_bin_deg).astype(np.int64), minlength=1)
            peak = (float(counts.argmax()) + 0.5) * p.heading_bin_deg
            turned = np.abs((heading - peak + 90) % 180 - 90)
            alike = np.flatnonzero(turned <= p.heading_tolerance_deg)
            fit = upright_plane(points[alike], p.wall.threshold_m)
            if fit is None or fit[1].sum() < p.min_points:
                break
            found.append(_Surface(fit[0], points[alike[fit[1]]]))
            points, heading = np.delete(points, alike[fit[1]], 0), np.delete(heading, alike[fit[1]])
        return found

    def _rectangle(self, surface: _Surface) -> _Surface | None:
        """The largest connected piece, if it is as wide and high as a leaf."""
        p = self.parameters
        leaf = _Surface(surface.plane, surface.points[pieces(surface.points, 3 * p.voxel_m) == 0])
        low, high = leaf.points[:, 2].min(), leaf.points[:, 2].max()
        fits = (
            p.leaf_width_m[0] <= covered_m(*leaf, p.wall.bin_m) <= p.leaf_width_m[1]
            and p.leaf_height_m[0] <= high - low <= p.leaf_height_m[1]
            and low < p.camera_heights_m[0]
            and high > p.camera_heights_m[1]
        )
        return leaf if fits else None

    def _hang(self, wall: _Surface, leaf: _Surface, view: tuple[float, float]) -> _Pair | None:
        """The pair, if the leaf hangs on the wall by one end or lies flush in it."""
        p = self.parameters
        wall_m = covered_m(*wall, p.wall.bin_m)
        low, high = leaf.points[:, 2].min(), min(leaf.points[:, 2].max(), p.wall.low_m)
        beside = wall.points[(wall.points[:, 2] > low) & (wall.points[:, 2] < high), :2]
        if wall_m < p.shortest_wall_m or len(beside) == 0:
            return None
        tilt = angle_deg(wall.plane.normal, leaf.plane.normal)
        if tilt < p.closed_below_deg:
            middle = leaf.points[:, :2].mean(axis=0)
            flush = (
                abs(float(np.median(wall.plane.distances_m(leaf.points)))) <= p.flush_m
                and wall_m > covered_m(*leaf, p.wall.bin_m)
                and np.linalg.norm(beside - middle, axis=1).min() <= p.farthest_wall_m
            )
            return _Pair(wall, leaf, tilt, None, False, wall_m) if flush else None
        hinge = np.linalg.solve(
            np.stack([wall.plane.normal[:2], leaf.plane.normal[:2]]),
            np.array([wall.plane.offset_m, leaf.plane.offset_m]),
        )
        outwards = leaf.points[:, :2].mean(axis=0) - hinge
        outwards /= np.linalg.norm(outwards)
        from_hinge, to_tip = np.quantile((leaf.points[:, :2] - hinge) @ outwards, (0.02, 0.98))
        # What the camera sees of the wall's line right at the hinge lies on its own side of the leaf: nothing hides it.
        side = np.array([-wall.plane.normal[1], wall.plane.normal[0]])
        side *= -np.sign(side @ leaf.plane.normal[:2])
        position = (beside - hinge) @ side
        if abs(from_hinge) > p.touch_m or np.abs(position).min() > p.farthest_wall_m:
            return None
        goes_on = ((position > p.hinge_m) & (position < p.opening_m[0])).sum() >= p.side_points
        if goes_on and ((-position > p.opening_m[0]) & (-position < p.opening_m[1])).sum() >= p.side_points:
            return None  # no opening: furniture, a pillar or another room's wall
        if goes_on:
            opening = -side
        elif _in_view(hinge + side * p.hinge_m, view):
            opening = side
        else:  # cannot be told: the smaller angle
            opening = side * np.sign(side @ outwards)
        angle = math.degrees(math.acos(np.clip(outwards @ opening, -1.0, 1.0)))
        across = (beside - hinge) @ opening
        gap = float(across[across > p.wall.opening_width_m[0]].min(initial=math.inf))
        width = gap if gap <= p.wall.opening_width_m[1] else None
        return _Pair(wall, leaf, angle, width, _in_view(hinge + outwards * to_tip, view), wall_m)


def _in_view(place: Floats, view: tuple[float, float]) -> bool:
    return view[0] < math.degrees(math.atan2(place[1], place[0])) < view[1]
