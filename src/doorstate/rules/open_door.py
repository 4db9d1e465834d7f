# SPDX-License-Identifier: Apache-2.0
"""Open doors from the edges of unmeasured readings: a reconstruction of Kaleci & Turgut 2020, not the authors' code.

Known of their rule: the cloud is gravity-aligned and organized; the corners of an open door are sought among the
neighbours of unmeasured readings; corners give boundary edges; the edges' dimensions are checked. How each step is
done, and every number, is chosen here, and so is the look at what stands beside the edges: a void between the free edge
of a half-open leaf and a jamb is as wide as a door, too.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from pydantic import Field
from scipy.spatial import cKDTree

from doorstate.clouds.measured import is_measured
from doorstate.rules.base import Detection, Parameters, Rule, RuleResult
from doorstate.rules.plan_lines import Flags, Floats, Line, strongest_line
from doorstate.rules.planes import thin
from doorstate.types import DoorState, Indices, Points

_MAX_BREAKS = 4  # of a row, that one opening may span; more is a room full of things
_MAX_CANDIDATES = 5  # openings of an image
_FEWEST_ROWS = 10  # of an edge, and of points beside it
_PLACE_M = 0.02  # within which points beside an edge count as one
_NOT_OPEN = "not open: this rule does not tell closed from semi-open"


class OpenDoorParameters(Parameters):
    """Of the open-door rule; no number of the authors is known."""

    unmeasured_run_px: int = Field(default=4, ge=1)  # chosen: single dropouts are no opening
    behind_m: float = Field(default=0.3, gt=0)  # chosen: more than a wall is thick
    # Chosen: a leaf hides a part of its opening, or its free edge, which stands off the wall, ends the run.
    run_width_m: tuple[float, float] = (0.3, 1.6)
    # Known: dimensions are checked. Chosen: single doors and frames of many countries; edges as far as in view.
    door_width_m: tuple[float, float] = (0.65, 1.25)
    edge_height_m: tuple[float, float] = (0.5, 2.4)
    edge_tilt_deg: float = Field(default=5.0, gt=0)  # chosen: the error of short edges; jambs are plumb
    edge_rms_m: float = Field(default=0.03, gt=0)  # chosen: noise of the sensor at 3.5 m
    chain_m: float = Field(default=0.08, gt=0)  # chosen: of both ends of a run from those of its neighbours
    support_ring_m: tuple[float, float] = (0.05, 0.7)  # chosen: from the edge to less than a leaf
    support_length_m: float = Field(default=0.15, gt=0)  # chosen: what is shorter is casing or clutter
    support_m: float = Field(default=0.03, gt=0)  # chosen: noise of the sensor, and a casing of 0.015 m
    support_share: float = Field(default=0.5, gt=0, le=1)  # chosen: of what is beside an edge, on one plane
    wall_depth_m: float = Field(default=0.25, gt=0)  # chosen: an edge is the near or far end of its reveal
    same_wall_deg: float = Field(default=10.0, gt=0)  # chosen: both sides of an opening are one wall
    open_leaf_deg: float = Field(default=70.0, gt=0)  # chosen: a leaf of 0.9 m then leaves 0.6 m free


class _Edges(NamedTuple):
    """Both ends of the runs of one opening, over rows: which of the measured points (K,) they are."""

    left: Indices
    right: Indices


@dataclass(frozen=True, eq=False)
class _View:
    """What was measured, row by row from left to right."""

    points: Floats  # (M, 3) metres
    row: Indices  # (M,)
    surface: Indices  # (M,) number of the piece of its row, without a jump, that a point belongs to
    breaks: Indices  # after which points a piece of the same row follows
    unmeasured: Flags  # of breaks: nothing was measured between the two


@dataclass(frozen=True, eq=False)
class _Side:
    """The upright surface beside an edge."""

    line: Line
    seen: bool  # False: nothing but the edge itself stands there, as of a leaf seen edge-on


class OpenDoorRule(Rule[OpenDoorParameters]):
    """Open or not open, from an organized cloud.

    Source: Kaleci & Turgut 2020, reconstructed from what is known of it.
    """

    defaults = OpenDoorParameters
    name = "open_door"
    source = "Kaleci & Turgut 2020 (a reconstruction from what is known, not the authors' code)"

    def __call__(self, cloud: Points) -> RuleResult:
        if cloud.ndim != 3:
            return RuleResult.abstain(
                "needs an organized cloud (H, W, 3): an opening is a run of unmeasured readings"
            )
        view = self._view(cloud)
        if not len(view.points):
            return RuleResult.abstain("nothing was measured")
        for edges in self._chains(view, self._runs(view)):
            ends = view.points[edges.left], view.points[edges.right]
            corners = self._corners(view, edges) if self._is_pair(ends) else None
            if corners is not None:
                return _opened(ends, corners)
        return RuleResult(None, _NOT_OPEN, open_or_not=False)

    def _view(self, cloud: Points) -> _View:
        flat = np.asarray(cloud).reshape(-1, 3)
        pixels = np.flatnonzero(is_measured(flat))
        points = flat[pixels].astype(np.float64)
        row, column = np.divmod(pixels, cloud.shape[1])
        same_row = np.diff(row) == 0
        unmeasured = np.diff(column) > self.parameters.unmeasured_run_px
        jumps = np.abs(np.diff(np.hypot(points[:, 0], points[:, 1]))) > self.parameters.behind_m
        surface = np.zeros(len(points), dtype=np.int64)
        surface[1:] = np.cumsum(unmeasured | jumps | ~same_row)
        breaks = np.flatnonzero(same_row & (unmeasured | jumps))
        return _View(points, row, surface, breaks, unmeasured[breaks])

    def _runs(self, view: _View) -> _Edges:
        """Ends of all runs of a row between which everything is unmeasured or far behind, of suitable width."""
        points, breaks = view.points, view.breaks
        low, high = self.parameters.run_width_m
        lefts, rights = [], []
        for more in range(_MAX_BREAKS):
            start = np.arange(len(breaks) - more)
            left, right = breaks[start], breaks[start + more] + 1
            one_row = view.row[left] == view.row[right]
            start, left, right = start[one_row], left[one_row], right[one_row]
            width_m = np.hypot(*(points[left] - points[right])[:, :2].T)
            kept = (low <= width_m) & (width_m <= high)
            start, left, right = start[kept], left[kept], right[kept]
            void = view.unmeasured[start] if more == 0 else np.ones(len(start), dtype=bool)
            for inner in range(more):
                # Between two breaks there is no jump, so that the ends of a piece speak for all of it.
                for end in (breaks[start + inner] + 1, breaks[start + inner + 1]):
                    void &= _beyond_m(points[end], points[left], points[right]) > self.parameters.behind_m
            lefts.append(left[void])
            rights.append(right[void])
        return _Edges(np.concatenate(lefts), np.concatenate(rights))

    def _chains(self, view: _View, runs: _Edges) -> Iterator[_Edges]:
        """Runs at one place in plan view, those of most rows first."""
        ends = np.hstack([view.points[runs.left, :2], view.points[runs.right, :2]])
        rest = np.arange(len(ends))
        for _ in range(_MAX_CANDIDATES):
            if len(rest) < _FEWEST_ROWS:
                return
            tree = cKDTree(ends[rest])
            counts = tree.query_ball_point(ends[rest], self.parameters.chain_m, return_length=True)
            chain = tree.query_ball_point(ends[rest[np.argmax(counts)]], self.parameters.chain_m)
            if len(chain) >= _FEWEST_ROWS:
                yield _Edges(runs.left[rest[chain]], runs.right[rest[chain]])
            rest = np.delete(rest, chain)

    def _is_pair(self, ends: tuple[Floats, Floats]) -> bool:
        """Whether two edges have the dimensions of a door's: height, plumb, straight, parallel."""
        chosen = self.parameters
        low, high = chosen.edge_height_m
        slopes = []
        for edge in ends:
            height_m = edge[:, 2] - edge[:, 2].mean()
            if not low <= np.ptp(height_m) <= high:
                return False
            design = np.stack([np.ones(len(edge)), height_m], axis=1)
            fit, *_ = np.linalg.lstsq(design, edge[:, :2], rcond=None)
            if np.square(edge[:, :2] - design @ fit).sum(axis=1).mean() > chosen.edge_rms_m**2:
                return False
            slopes.append(fit[1])
        steepest = np.tan(np.radians(chosen.edge_tilt_deg))
        return all(np.hypot(*slope) <= steepest for slope in (*slopes, slopes[0] - slopes[1]))

    def _corners(self, view: _View, edges: _Edges) -> Floats | None:
        """Corners (2, 2) of the opening in plan view, left and right; None if no door's opening is there."""
        low_m, high_m = self.parameters.door_width_m
        places = [np.median(view.points[edge, :2], axis=0) for edge in edges]
        sides = [self._side(view, edge, place) for edge, place in zip(edges, places, strict=True)]
        for one, other in ((0, 1), (1, 0)):
            wall, beside = sides[one], sides[other]
            if wall is None or beside is None or not wall.seen:
                continue
            near = wall.line.foot(places[one])
            far = self._far_corner(wall.line, near, places[one], beside, places[other])
            if far is not None and low_m <= float(np.hypot(*(near - far))) <= high_m:
                return np.stack([near, far] if one == 0 else [far, near])
        return None

    def _side(self, view: _View, edge: Indices, place: Floats) -> _Side | None:
        """The surface that an edge ends, from there on; None if it is no upright plane."""
        chosen = self.parameters
        same = np.zeros(view.surface[-1] + 1, dtype=bool)
        same[view.surface[edge]] = True
        points = view.points[same[view.surface], :2]
        reach_m = np.hypot(*(points - place).T)
        ring = points[(reach_m > chosen.support_ring_m[0]) & (reach_m < chosen.support_ring_m[1])]
        if len(ring) < _FEWEST_ROWS:
            return _Side(Line(place, place / np.hypot(*place)), seen=False)
        # A place counts once, however many pixels saw it: a reveal is seen head-on where the wall is seen at a slant.
        places = thin(ring, _PLACE_M)
        found = strongest_line(places, chosen.support_m)
        if found is None:
            return None
        line, on_line = found
        long_enough = np.ptp(line.along_m(places[on_line])) >= chosen.support_length_m
        return _Side(line, seen=True) if long_enough and on_line.mean() >= chosen.support_share else None

    def _far_corner(
        self, wall: Line, near: Floats, edge: Floats, beside: _Side, other_edge: Floats
    ) -> Floats | None:
        """Corner (2,) of an opening in this wall beyond the one that is near; None if it is none of an open door."""
        chosen = self.parameters
        off_m = np.abs(wall.behind_m(np.stack([edge, other_edge])))
        if off_m[0] > chosen.wall_depth_m:
            return None
        if wall.angle_deg(beside.line) <= chosen.same_wall_deg:
            coplanar = beside.seen and off_m[1] <= chosen.wall_depth_m
            return wall.foot(other_edge) if coplanar else None
        # A leaf ends at its edge; seen edge-on, it stands off the wall.
        reach_m = abs(float(beside.line.behind_m(other_edge)))
        if reach_m > chosen.wall_depth_m or (not beside.seen and off_m[1] <= chosen.wall_depth_m):
            return None
        hinge = wall.crossing(beside.line)
        leaf, closed = beside.line.centre - hinge, near - hinge
        # Taken for a wall, a leaf leads from its free edge back to the hinge, a wall away from it.
        leads_away = float((wall.centre - near) @ closed) > 0
        cosine = leaf @ closed / (np.hypot(*leaf) * np.hypot(*closed))
        return hinge if leads_away and cosine <= np.cos(np.radians(chosen.open_leaf_deg)) else None


def _beyond_m(points: Floats, left: Floats, right: Floats) -> Floats:
    """How far points (K, 3) lie behind the lines from left to right in plan view, as the camera sees it."""
    along = right[:, :2] - left[:, :2]
    normal = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.hypot(*along.T)[:, None]
    normal *= np.sign((normal * left[:, :2]).sum(axis=1, keepdims=True))
    beyond: Floats = (normal * (points - left)[:, :2]).sum(axis=1)
    return beyond


def _opened(ends: tuple[Floats, Floats], corners: Floats) -> RuleResult:
    low_m = max(edge[:, 2].min() for edge in ends)
    high_m = min(edge[:, 2].max() for edge in ends)
    left, right = corners
    outline = np.array([[*left, low_m], [*left, high_m], [*right, high_m], [*right, low_m]])
    edges = [np.array([[*np.median(edge[:, :2], axis=0), z] for z in (low_m, high_m)]) for edge in ends]
    return RuleResult(
        DoorState.OPEN,
        opening_width_m=float(np.hypot(*(left - right))),
        open_or_not=True,
        detections=(
            Detection("opening", outline),
            *(Detection("edge", edge) for edge in edges),
            *(Detection("corner", corner[None]) for corner in outline),
        ),
    )
