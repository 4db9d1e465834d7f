# SPDX-License-Identifier: Apache-2.0
"""State from the angle of wall and leaf: a reconstruction from what is known of two papers, not the authors' code.

Known of Ning et al. 2023: planes by random samples, the wall, straight lines fitted to the projected points, and the
state from the angle between the lines of wall and door. Known of Quintana et al. 2018: cells of the wall plane, and a
door-sized region of empty ones is an open door. How each step is done, and every number, is chosen here.

A closed leaf lies in the wall or a little behind it and is no plane of its own. So a wall that is seen without a gap
over more than a door and its jambs counts as closed: the rule is asked about a door in view and does not look whether
there is one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate.rules.base import Detection, Parameters, Rule, RuleResult, measured
from doorstate.rules.plan_lines import Flags, Floats, Line, fit_line, strongest_line
from doorstate.rules.planes import grid, thin
from doorstate.types import DoorState, Points

_FEWEST_POINTS = 128  # of a cloud that anything is told from
_MAX_LINES = 5  # in plan view that may be the wall, and beside it the leaf
_MAX_ROWS = 160  # of an image: the columns of a wall need no more, and time is saved
_LEVEL_M = 0.1  # of heights that are seen or not
_FEWEST_COLUMNS = 3  # of a gap in a wall
_GAP_CELLS = 3  # in a leaf
_BESIDE_M = (0.1, 0.7)  # of a hinge, where there is wall on one side and none on the other
_BORDER_DEG = 1.5  # from the end of the field of view, where a surface goes on unseen
_EDGE_SHARE = 0.2  # how far a leaf's length may be from the opening's width
_OCCUPIED, _HIDDEN, _VOID, _OUTSIDE = range(4)


class WallLeafAngleParameters(Parameters):
    """Of the rule of wall and leaf; the authors' numbers are not known."""

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
class _Plan:
    """Upright things in plan view, as cells."""

    centres_m: Floats  # (K, 2)
    heights_m: Floats  # (K,) how much of each is seen
    tops_m: Floats  # (K,) above the camera


@dataclass(frozen=True, eq=False)
class _Wall:
    """A wall and what is seen of it, column by column."""

    line: Line
    places_m: Floats  # (C,) middles of the columns along the line
    seen: NDArray[np.int64]  # (C,) occupied, hidden, void or outside


@dataclass(frozen=True, eq=False)
class _Leaf:
    """A leaf that stands off the wall."""

    hinge: Floats  # (2,)
    tip: Floats  # (2,)
    angle_deg: float
    closing: float  # +1 or -1: which way along the wall it closes


class WallLeafAngleRule(Rule[WallLeafAngleParameters]):
    """Three states and the opening angle, from flat or organized clouds.

    Source: Ning et al. 2023, Quintana et al. 2018, reconstructed from what is known of them.
    """

    defaults = WallLeafAngleParameters
    name = "wall_leaf_angle"
    source = (
        "Ning et al. 2023, Quintana et al. 2018 (a reconstruction from what is known, not the authors' code)"
    )

    def __call__(self, cloud: Points) -> RuleResult:
        if cloud.ndim == 3:
            cloud = cloud[:: max(1, len(cloud) // _MAX_ROWS)]
        points = measured(cloud)
        points = points[(np.abs(points) < self.parameters.reach_m).all(axis=1)]
        points = points[points[:, 2] <= self.parameters.slice_top_m]
        if len(points) < _FEWEST_POINTS:
            return RuleResult.abstain(
                f"too few points: {len(points)} of use, at least {_FEWEST_POINTS} are needed"
            )
        points = thin(points, self.parameters.voxel_m)
        plan = self._plan(points)
        walls = [self._wall(line, plan, points) for line in self._walls(plan, points)]
        if not walls:
            return RuleResult.abstain("no wall: no upright plane extends farther than a door is wide")
        answers = [self._answer(wall, plan, points) for wall in walls]
        # A corridor has more walls than one: that with a leaf or an opening is the door's.
        ajar = (answer for answer in answers if answer.state in (DoorState.SEMI_OPEN, DoorState.OPEN))
        closed = (answer for answer in answers if answer.state is DoorState.CLOSED)
        return next(ajar, next(closed, answers[0]))

    def _plan(self, points: Floats) -> _Plan:
        """Cells of the plan that something upright stands in."""
        chosen = self.parameters
        cell, centres = grid(points[:, :2], chosen.cell_m)
        level = np.floor(points[:, 2] / _LEVEL_M).astype(np.int64)
        levels = np.unique(np.stack([cell, level], axis=1), axis=0)[:, 0]
        heights_m: Floats = np.bincount(levels, minlength=len(centres)) * np.float64(_LEVEL_M)
        tops_m = np.full(len(centres), -np.inf)
        np.maximum.at(tops_m, cell, points[:, 2])
        upright = heights_m >= chosen.upright_m
        return _Plan(centres[upright], heights_m[upright], tops_m[upright])

    def _walls(self, plan: _Plan, points: Floats) -> list[Line]:
        """Lines that are longer than a leaf, the strongest first; if there are none, lines that the view cuts off."""
        field = _azimuth_rad(points)
        ends_rad = np.array([field.min(), field.max()])
        long, cut = [], []
        for line, on_line in _lines(plan.centres_m, plan.heights_m, self.parameters.line_m):
            places = plan.centres_m[on_line]
            along_m = line.along_m(places)
            length_m = float(np.ptp(along_m))
            if len(places) * self.parameters.cell_m < self.parameters.leaf_length_m[0]:
                continue
            refitted = self._refit(line, points[:, :2], (along_m.min(), along_m.max()))
            if length_m >= self.parameters.wall_extent_m:
                long.append(refitted)
            elif np.abs(_azimuth_rad(places)[:, None] - ends_rad).min() < np.radians(_BORDER_DEG):
                cut.append(refitted)
        return long or cut

    def _refit(self, line: Line, points: Floats, ends_m: tuple[float, float]) -> Line:
        """The line of the points near a line between two places of it."""
        along_m = line.along_m(points)
        near = (
            (np.abs(line.behind_m(points)) <= self.parameters.fit_m)
            & (along_m >= ends_m[0])
            & (along_m <= ends_m[1])
        )
        return fit_line(points[near]) if near.sum() >= 2 else line

    def _wall(self, line: Line, plan: _Plan, points: Floats) -> _Wall:
        """What is seen of every column of the wall."""
        chosen = self.parameters
        behind_m, along_m = line.behind_m(plan.centres_m), line.along_m(plan.centres_m)
        in_wall = (behind_m >= -chosen.in_front_m) & (behind_m <= chosen.recess_m)
        beyond_m = chosen.opening_width_m[1]  # a door's opening may be where the wall seen ends
        first, last = along_m[in_wall].min() - beyond_m, along_m[in_wall].max() + beyond_m
        places_m = np.arange(first + chosen.cell_m / 2, last, chosen.cell_m)
        column = np.floor((along_m - first) / chosen.cell_m).astype(np.int64)
        seen = np.full(len(places_m), _VOID)
        centres = line.centre + places_m[:, None] * line.direction
        azimuth = _azimuth_rad(centres)
        range_m = np.hypot(*centres.T)
        field = _azimuth_rad(points)
        outside = (azimuth < field.min()) | (azimuth > field.max()) | (centres[:, 0] > points[:, 0].max())
        seen[outside] = _OUTSIDE
        front = plan.centres_m[behind_m < -chosen.in_front_m]
        front_range_m = np.hypot(*front.T)
        apart = np.abs(azimuth[:, None] - _azimuth_rad(front))
        hides = (apart * front_range_m <= chosen.cell_m / 2) & (front_range_m < range_m[:, None])
        seen[hides.any(axis=1)] = _HIDDEN
        seen[column[in_wall & (column >= 0) & (column < len(seen))]] = _OCCUPIED
        return _Wall(line, places_m, seen)

    def _answer(self, wall: _Wall, plan: _Plan, points: Floats) -> RuleResult:
        """What the columns of one wall, and the leaf that stands off it, say."""
        ends_m = wall.places_m[wall.seen == _OCCUPIED][[0, -1]]
        first, last = (wall.line.at(float(end)) for end in ends_m)
        outline = Detection("wall", _upright(first, last, points))
        gaps = self._gaps(wall)
        opening = next((gap for gap in gaps if self._is_opening(wall, gap)), None)
        leaf = self._leaf(wall, plan, points)
        if leaf is None and opening is not None:
            leaf = self._edge_on_leaf(wall, opening, plan)
        if leaf is not None:
            return self._of_leaf(wall, leaf, points, outline)
        if opening is not None:
            shape = Detection("opening", _upright(wall.line.at(opening[0]), wall.line.at(opening[1]), points))
            return RuleResult(
                DoorState.OPEN,
                opening_width_m=opening[1] - opening[0],
                open_or_not=True,
                detections=(outline, shape),
            )
        ends = [ends_m[0], *np.ravel(gaps), ends_m[-1]]
        unbroken_m = max(end - start for start, end in zip(ends[::2], ends[1::2], strict=True))
        beyond = (float(wall.places_m[0]), ends_m[0]), (ends_m[-1], float(wall.places_m[-1]))
        voids = [self._void_m(wall, gap) for gap in (*gaps, *beyond)]
        whole = max(voids) < self.parameters.opening_width_m[0] / 2
        if whole and unbroken_m >= self.parameters.wall_extent_m:
            return RuleResult(
                DoorState.CLOSED, opening_angle_deg=0.0, open_or_not=False, detections=(outline,)
            )
        if whole:
            return RuleResult.abstain(
                "one plane only, and too little of it to call it a wall with a closed door", outline
            )
        return RuleResult.abstain(
            "the wall is broken, but no door-sized opening and no leaf is seen", outline
        )

    def _gaps(self, wall: _Wall) -> list[tuple[float, float]]:
        """Between which places of the wall no column is occupied; single columns do not count."""
        occupied = np.flatnonzero(wall.seen == _OCCUPIED)
        before = np.flatnonzero(np.diff(occupied) > _FEWEST_COLUMNS)
        half_m = self.parameters.cell_m / 2
        starts, ends = wall.places_m[occupied[before]] + half_m, wall.places_m[occupied[before + 1]] - half_m
        return [(float(start), float(end)) for start, end in zip(starts, ends, strict=True)]

    def _is_opening(self, wall: _Wall, gap: tuple[float, float]) -> bool:
        low_m, high_m = self.parameters.opening_width_m
        width_m = gap[1] - gap[0]
        return low_m <= width_m <= high_m and self._void_m(wall, gap) >= self.parameters.void_share * width_m

    def _void_m(self, wall: _Wall, gap: tuple[float, float]) -> float:
        """How much of a gap is looked through."""
        inside = wall.seen[(wall.places_m > gap[0]) & (wall.places_m < gap[1])]
        return float((inside == _VOID).sum()) * self.parameters.cell_m

    def _leaf(self, wall: _Wall, plan: _Plan, points: Floats) -> _Leaf | None:
        """The strongest upright plane of a leaf's length that stands off the wall with one end at it."""
        chosen = self.parameters
        longest_m = chosen.leaf_length_m[1]
        off_m = np.abs(wall.line.behind_m(plan.centres_m))
        # Somewhat farther than a leaf reaches: a side wall must not be cut to a leaf's length.
        off_wall = (
            (off_m > chosen.in_front_m) & (off_m <= 1.5 * longest_m) & (plan.tops_m >= chosen.leaf_top_m)
        )
        cells = plan.centres_m[off_wall]
        for rough, on_line in _lines(cells, plan.heights_m[off_wall], chosen.line_m):
            start_m, end_m = _longest_piece(rough.along_m(cells[on_line]), _GAP_CELLS * chosen.cell_m)
            if not chosen.leaf_length_m[0] <= end_m - start_m <= longest_m:
                continue
            ends = [rough.at(start_m), rough.at(end_m)]
            line = self._refit(rough, points[:, :2], (start_m, end_m))
            if line.angle_deg(wall.line) < chosen.closed_below_deg:
                continue
            hinge = line.crossing(wall.line)
            near, tip = sorted(
                (line.foot(end) for end in ends), key=lambda end: float(np.hypot(*(end - hinge)))
            )
            between = float((near - hinge) @ (tip - hinge)) < 0  # it crosses the wall
            if (
                between
                or np.hypot(*(near - hinge)) > chosen.hinge_gap_m
                or np.hypot(*(tip - hinge)) > longest_m
            ):
                continue
            closing = self._closing(wall, hinge, tip)
            if closing:
                return _Leaf(hinge, tip, _opened_deg(tip - hinge, closing * wall.line.direction), closing)
        return None

    def _closing(self, wall: _Wall, hinge: Floats, tip: Floats) -> float:
        """Which way along the wall a leaf closes, +1 or -1: where there is less wall; 0 if there is wall both ways."""
        from_hinge_m = wall.places_m - float(wall.line.along_m(hinge))
        walled = []
        for way in (1.0, -1.0):
            side = wall.seen[(way * from_hinge_m > _BESIDE_M[0]) & (way * from_hinge_m < _BESIDE_M[1])]
            occupied, void = (float((side == kind).sum()) for kind in (_OCCUPIED, _VOID))
            walled.append((occupied - void) * self.parameters.cell_m / (_BESIDE_M[1] - _BESIDE_M[0]))
        if min(walled) > 1 - self.parameters.void_share:
            return 0.0
        if walled[0] == walled[1]:  # neither way is seen; fewer doors stand open beyond 90 degrees than below
            return 1.0 if (tip - hinge) @ wall.line.direction >= 0 else -1.0
        return float(np.sign(walled[1] - walled[0]))

    def _edge_on_leaf(self, wall: _Wall, opening: tuple[float, float], plan: _Plan) -> _Leaf | None:
        """A leaf on the line of sight to its hinge: its edge is seen as far from a jamb as the opening is wide."""
        width_m = opening[1] - opening[0]
        behind_m = wall.line.behind_m(plan.centres_m)
        off_wall = (behind_m < -self.parameters.in_front_m) | (behind_m > self.parameters.recess_m)
        cells = plan.centres_m[off_wall & (plan.tops_m >= self.parameters.leaf_top_m)]
        for place, closing in zip(opening, (1.0, -1.0), strict=True):
            hinge = wall.line.at(place)
            reach = np.hypot(*(cells - hinge).T) / width_m
            turned = _azimuth_rad(cells) - np.arctan2(hinge[1], hinge[0])
            edge = cells[
                (np.abs(reach - 1) < _EDGE_SHARE) & (np.abs(turned) < np.radians(self.parameters.edge_on_deg))
            ]
            if len(edge):
                tip = edge.mean(axis=0)
                return _Leaf(hinge, tip, _opened_deg(tip - hinge, closing * wall.line.direction), closing)
        return None

    def _of_leaf(self, wall: _Wall, leaf: _Leaf, points: Floats, outline: Detection) -> RuleResult:
        chosen = self.parameters
        low_m, high_m = chosen.opening_width_m
        hinge_m = float(wall.line.along_m(leaf.hinge))
        occupied_m = leaf.closing * (wall.places_m[wall.seen == _OCCUPIED] - hinge_m) - chosen.cell_m / 2
        strike_m = occupied_m[occupied_m >= low_m].min(initial=np.inf)
        width_m = float(strike_m) if strike_m <= high_m else None
        shapes = [outline, Detection("leaf", _upright(leaf.hinge, leaf.tip, points))]
        if width_m is not None:
            strike = leaf.hinge + leaf.closing * width_m * wall.line.direction
            shapes.append(Detection("opening", _upright(leaf.hinge, strike, points)))
        state = DoorState.SEMI_OPEN if leaf.angle_deg < chosen.open_from_deg else DoorState.OPEN
        if leaf.angle_deg < chosen.closed_below_deg:
            state = DoorState.CLOSED
        return RuleResult(
            state,
            opening_angle_deg=leaf.angle_deg,
            opening_width_m=width_m,
            open_or_not=state is DoorState.OPEN,
            detections=tuple(shapes),
        )


def _azimuth_rad(places: Floats) -> Floats:
    azimuth: Floats = np.arctan2(places[:, 1], places[:, 0])
    return azimuth


def _lines(cells: Floats, weights: Floats, threshold_m: float) -> Iterator[tuple[Line, Flags]]:
    """Lines in plan view, the strongest first, with the cells (K,) of each; a cell belongs to one line only."""
    free = np.arange(len(cells))
    for _ in range(_MAX_LINES):
        found = strongest_line(cells[free], threshold_m, weights[free])
        if found is None:
            return
        line, on_line = found
        flags = np.zeros(len(cells), dtype=bool)
        flags[free[on_line]] = True
        yield line, flags
        free = free[~on_line]


def _longest_piece(along_m: Floats, gap_m: float) -> tuple[float, float]:
    """From where to where the longest run of places without a gap goes."""
    ordered = np.sort(along_m)
    cuts = np.flatnonzero(np.diff(ordered) > gap_m)
    starts, ends = ordered[np.append(0, cuts + 1)], ordered[np.append(cuts, len(ordered) - 1)]
    longest = int(np.argmax(ends - starts))
    return float(starts[longest]), float(ends[longest])


def _opened_deg(leaf: Floats, closed: Floats) -> float:
    """Angle (0 to 180) between a leaf and where it lies when it is closed, both from the hinge."""
    return float(np.degrees(np.arctan2(abs(leaf[0] * closed[1] - leaf[1] * closed[0]), leaf @ closed)))


def _upright(one: Floats, other: Floats, points: Floats) -> Floats:
    """Outline (4, 3) of the plane over two places of the plan, as high as the cloud."""
    low, high = points[:, 2].min(), points[:, 2].max()
    return np.array([[*one, low], [*one, high], [*other, high], [*other, low]])
