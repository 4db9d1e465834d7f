# SPDX-License-Identifier: Apache-2.0
"""State from the angle between wall and leaf: a reconstruction of two publications, not the authors' code.

Ning et al. 2023 describe planes by random samples, the wall, straight lines fitted to the projected points, and the
state from the angle between the lines of wall and door. Quintana et al. 2018 describe cells of the wall plane, and a
door-sized region of empty cells as an open door. The details of each step and every number are chosen here.

A closed leaf lies in the wall or a little behind it and is no plane of its own. So a wall that is visible without a gap
over more than a door and its jambs counts as closed: the rule is for a door in view and does not check that there is
one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import Field

from doorstate.doorways.plan_lines import Floats, Line, fit_line
from doorstate.doorways.planes import voxel_downsample
from doorstate.rules.base import Detection, Parameters, Rule, RuleResult, measured_points
from doorstate.rules.floor_plan import FloorPlan, azimuth_rad, floor_plan, strongest_lines
from doorstate.rules.wall_columns import Gap, WallColumns, wall_columns
from doorstate.types import DoorState, Points

_MIN_POINTS = 128
_MAX_ROWS = 160  # of an image: the columns of a wall need no more, and time is saved
_LEAF_GAP_CELLS = 3
_BORDER_DEG = 1.5  # from the end of the field of view, where a surface continues unseen
_LENGTH_TOLERANCE_SHARE = 0.2  # between the length of a leaf and the width of its opening


class WallLeafAngleParameters(Parameters):
    """Parameters of the rule of wall and leaf; the authors' values are not published."""

    reach_m: float = Field(default=10.0, gt=0)  # chosen: depth cameras see no wall beyond
    voxel_m: float = Field(default=0.03, gt=0)  # chosen: four of them in the thickness of a wall
    cell_m: float = Field(default=0.05, gt=0)  # chosen: of the plan, and of columns of the wall
    slice_top_m: float = 0.7  # chosen: above the camera; below a lintel if the camera is 1.3 m up at most
    upright_m: float = Field(default=0.3, gt=0)  # chosen: cells of less height are floor or low things
    line_m: float = Field(default=0.03, gt=0)  # chosen: noise at 3.5 m, and casings of 0.015 m
    fit_m: float = Field(default=0.02, gt=0)  # chosen: of the last fit, to single points
    wall_extent_m: float = Field(default=1.2, gt=0)  # chosen: no leaf of a single door is as wide
    in_front_m: float = Field(default=0.06, gt=0)  # chosen: casings and a leaf 3 degrees open are still wall
    recess_m: float = Field(default=0.2, gt=0)  # chosen: a closed leaf at the far face of its wall
    leaf_length_m: tuple[float, float] = (0.25, 1.15)  # chosen: a part in view of a leaf, and the widest leaf
    leaf_top_m: float = 0.2  # chosen: above the camera: what ends below is furniture
    hinge_gap_m: float = Field(default=0.35, gt=0)  # chosen: how far 10 degrees stay within in_front_m
    opening_width_m: tuple[float, float] = (0.6, 1.3)  # chosen: single doors and their frames
    void_share: float = Field(default=0.5, gt=0, le=1)  # chosen: of an opening that must be looked through
    edge_on_deg: float = Field(default=4.0, gt=0)  # chosen: nearer to the line of sight, only an edge is seen
    closed_below_deg: float = Field(default=8.0, gt=0)  # chosen: a leaf of 0.9 m is then 0.13 m ajar
    open_from_deg: float = Field(default=70.0, gt=0)  # chosen: a leaf of 0.9 m then leaves 0.6 m free


@dataclass(frozen=True, eq=False)
class _Leaf:
    """Leaf that stands off the wall."""

    hinge: Floats  # (2,)
    tip: Floats  # (2,)
    angle_deg: float
    closing: float  # direction along the wall in which it closes, +1 or -1


class WallLeafAngleRule(Rule[WallLeafAngleParameters]):
    """Three states and the opening angle, from flat or organized clouds.

    Source: Ning et al. 2023, Quintana et al. 2018, reconstructed from the publications.
    """

    name = "wall_leaf_angle"
    source = "Ning et al. 2023, Quintana et al. 2018 (a reconstruction, not the authors' code)"
    defaults = WallLeafAngleParameters

    def __call__(self, cloud: Points) -> RuleResult:
        p = self.parameters
        if cloud.ndim == 3:
            cloud = cloud[:: max(1, len(cloud) // _MAX_ROWS)]
        points = measured_points(cloud)
        points = points[(np.abs(points) < p.reach_m).all(axis=1)]
        points = points[points[:, 2] <= p.slice_top_m]
        if len(points) < _MIN_POINTS:
            return RuleResult.abstain(
                f"too few points: {len(points)} of use, at least {_MIN_POINTS} are needed"
            )
        points = voxel_downsample(points, p.voxel_m)
        plan = floor_plan(points, p.cell_m, p.upright_m)
        results = [self._wall_result(line, plan, points) for line in self._wall_lines(plan, points)]
        if not results:
            return RuleResult.abstain("no wall: no upright plane extends farther than a door is wide")
        # A corridor has several walls; the one with a leaf or an opening is the door's.
        ajar = (result for result in results if result.state in (DoorState.SEMI_OPEN, DoorState.OPEN))
        closed = (result for result in results if result.state is DoorState.CLOSED)
        return next(ajar, next(closed, results[0]))

    def _wall_lines(self, plan: FloorPlan, points: Floats) -> list[Line]:
        """Return lines longer than a leaf, the strongest first; if there are none, lines cut by the view's border."""
        p = self.parameters
        view = azimuth_rad(points)
        borders_rad = np.array([view.min(), view.max()])
        long, cut = [], []
        for line, on_line in strongest_lines(plan.centres_m, plan.heights_m, p.line_m):
            places = plan.centres_m[on_line]
            along_m = line.along_m(places)
            length_m = float(np.ptp(along_m))
            if len(places) * p.cell_m < p.leaf_length_m[0]:
                continue
            refitted = self._refit(line, points[:, :2], (along_m.min(), along_m.max()))
            if length_m >= p.wall_extent_m:
                long.append(refitted)
            elif np.abs(azimuth_rad(places)[:, None] - borders_rad).min() < np.radians(_BORDER_DEG):
                cut.append(refitted)
        return long or cut

    def _refit(self, line: Line, points: Floats, ends_m: tuple[float, float]) -> Line:
        """Return the line fitted to the points (N, 2) near a line between two positions on it."""
        along_m = line.along_m(points)
        near = (
            (np.abs(line.behind_m(points)) <= self.parameters.fit_m)
            & (along_m >= ends_m[0])
            & (along_m <= ends_m[1])
        )
        return fit_line(points[near]) if near.sum() >= 2 else line

    def _wall_result(self, line: Line, plan: FloorPlan, points: Floats) -> RuleResult:
        """Return the result of one wall: from its leaf, else from an opening in it, else from the bare wall."""
        p = self.parameters
        wall = wall_columns(
            line,
            plan,
            points,
            column_m=p.cell_m,
            in_front_m=p.in_front_m,
            recess_m=p.recess_m,
            max_opening_m=p.opening_width_m[1],
        )
        start, end = (line.at(float(end_m)) for end_m in wall.ends_m)
        detection = Detection("wall", _upright_rectangle(start, end, points))
        opening = next((gap for gap in wall.gaps() if self._is_opening(wall, gap)), None)
        leaf = self._leaf(wall, plan, points)
        if leaf is None and opening is not None:
            leaf = self._edge_on_leaf(wall, opening, plan)
        if leaf is not None:
            return self._leaf_result(wall, leaf, points, detection)
        if opening is not None:
            left, right = (line.at(edge_m) for edge_m in opening)
            return RuleResult(
                DoorState.OPEN,
                opening_width_m=opening[1] - opening[0],
                open_or_not=True,
                detections=(detection, Detection("opening", _upright_rectangle(left, right, points))),
            )
        return self._bare_wall_result(wall, detection)

    def _is_opening(self, wall: WallColumns, gap: Gap) -> bool:
        low_m, high_m = self.parameters.opening_width_m
        width_m = gap[1] - gap[0]
        return low_m <= width_m <= high_m and wall.void_m(gap) >= self.parameters.void_share * width_m

    def _bare_wall_result(self, wall: WallColumns, detection: Detection) -> RuleResult:
        if wall.longest_void_m() >= self.parameters.opening_width_m[0] / 2:
            return RuleResult.abstain(
                "the wall is broken, but no door-sized opening and no leaf is seen", detection
            )
        if wall.unbroken_m() < self.parameters.wall_extent_m:
            return RuleResult.abstain(
                "one plane only, and too little of it to call it a wall with a closed door", detection
            )
        return RuleResult(DoorState.CLOSED, opening_angle_deg=0.0, open_or_not=False, detections=(detection,))

    def _leaf(self, wall: WallColumns, plan: FloorPlan, points: Floats) -> _Leaf | None:
        """Return the strongest upright plane of a leaf's length that stands off the wall with one end at it."""
        p = self.parameters
        longest_m = p.leaf_length_m[1]
        off_m = np.abs(wall.line.behind_m(plan.centres_m))
        # Somewhat farther than a leaf reaches: a side wall must not be cut to a leaf's length.
        off_wall = (off_m > p.in_front_m) & (off_m <= 1.5 * longest_m) & (plan.tops_m >= p.leaf_top_m)
        cells = plan.centres_m[off_wall]
        for rough, on_line in strongest_lines(cells, plan.heights_m[off_wall], p.line_m):
            start_m, end_m = _longest_run(rough.along_m(cells[on_line]), _LEAF_GAP_CELLS * p.cell_m)
            if not p.leaf_length_m[0] <= end_m - start_m <= longest_m:
                continue
            ends = [rough.at(start_m), rough.at(end_m)]
            line = self._refit(rough, points[:, :2], (start_m, end_m))
            leaf = self._hang(wall, line, ends)
            if leaf is not None:
                return leaf
        return None

    def _hang(self, wall: WallColumns, line: Line, ends: list[Floats]) -> _Leaf | None:
        """Return the leaf along a line with two ends (2,), if one of them is at a hinge of the wall."""
        p = self.parameters
        if line.angle_deg(wall.line) < p.closed_below_deg:
            return None
        hinge = line.crossing(wall.line)
        near, tip = sorted((line.foot(end) for end in ends), key=lambda end: float(np.hypot(*(end - hinge))))
        crosses_wall = float((near - hinge) @ (tip - hinge)) < 0
        too_far = np.hypot(*(near - hinge)) > p.hinge_gap_m or np.hypot(*(tip - hinge)) > p.leaf_length_m[1]
        if crosses_wall or too_far:
            return None
        closing = wall.closing_direction(hinge, tip, p.void_share)
        if not closing:
            return None
        return _Leaf(hinge, tip, _opening_angle_deg(tip - hinge, closing * wall.line.direction), closing)

    def _edge_on_leaf(self, wall: WallColumns, opening: Gap, plan: FloorPlan) -> _Leaf | None:
        """Return a leaf on the line of sight to its hinge: its edge is as far from a jamb as the opening is wide."""
        p = self.parameters
        width_m = opening[1] - opening[0]
        behind_m = wall.line.behind_m(plan.centres_m)
        off_wall = (behind_m < -p.in_front_m) | (behind_m > p.recess_m)
        cells = plan.centres_m[off_wall & (plan.tops_m >= p.leaf_top_m)]
        for jamb_m, closing in zip(opening, (1.0, -1.0), strict=True):
            hinge = wall.line.at(jamb_m)
            reach = np.hypot(*(cells - hinge).T) / width_m
            turned = azimuth_rad(cells) - np.arctan2(hinge[1], hinge[0])
            edge = cells[
                (np.abs(reach - 1) < _LENGTH_TOLERANCE_SHARE) & (np.abs(turned) < np.radians(p.edge_on_deg))
            ]
            if len(edge):
                tip = edge.mean(axis=0)
                angle_deg = _opening_angle_deg(tip - hinge, closing * wall.line.direction)
                return _Leaf(hinge, tip, angle_deg, closing)
        return None

    def _leaf_result(
        self, wall: WallColumns, leaf: _Leaf, points: Floats, detection: Detection
    ) -> RuleResult:
        p = self.parameters
        low_m, high_m = p.opening_width_m
        hinge_m = float(wall.line.along_m(leaf.hinge))
        occupied_m = leaf.closing * (wall.positions_m[wall.occupied] - hinge_m) - p.cell_m / 2
        strike_m = occupied_m[occupied_m >= low_m].min(initial=np.inf)
        width_m = float(strike_m) if strike_m <= high_m else None
        detections = [detection, Detection("leaf", _upright_rectangle(leaf.hinge, leaf.tip, points))]
        if width_m is not None:
            strike = leaf.hinge + leaf.closing * width_m * wall.line.direction
            detections.append(Detection("opening", _upright_rectangle(leaf.hinge, strike, points)))
        state = DoorState.SEMI_OPEN if leaf.angle_deg < p.open_from_deg else DoorState.OPEN
        if leaf.angle_deg < p.closed_below_deg:
            state = DoorState.CLOSED
        return RuleResult(
            state,
            opening_angle_deg=leaf.angle_deg,
            opening_width_m=width_m,
            open_or_not=state is DoorState.OPEN,
            detections=tuple(detections),
        )


def _longest_run(along_m: Floats, gap_m: float) -> tuple[float, float]:
    """Return the ends of the longest run of positions without a gap."""
    ordered = np.sort(along_m)
    cuts = np.flatnonzero(np.diff(ordered) > gap_m)
    starts, ends = ordered[np.append(0, cuts + 1)], ordered[np.append(cuts, len(ordered) - 1)]
    longest = int(np.argmax(ends - starts))
    return float(starts[longest]), float(ends[longest])


def _opening_angle_deg(leaf: Floats, closed: Floats) -> float:
    """Return the angle (0 to 180) between a leaf and its closed position, both vectors (2,) from the hinge."""
    return float(np.degrees(np.arctan2(abs(leaf[0] * closed[1] - leaf[1] * closed[0]), leaf @ closed)))


def _upright_rectangle(start: Floats, end: Floats, points: Floats) -> Floats:
    """Return the outline (4, 3) of the plane between two places (2,), as high as the cloud."""
    low, high = points[:, 2].min(), points[:, 2].max()
    return np.array([[*start, low], [*start, high], [*end, high], [*end, low]])
