# SPDX-License-Identifier: Apache-2.0
"""Open doors from the edges of unmeasured readings: a reconstruction of Kaleci & Turgut 2020, not the authors' code.

The publication says: the cloud is gravity-aligned and organized; the corners of an open door are sought among the
neighbours of unmeasured readings; corners give boundary edges; the edges' dimensions are checked. The details of each
step and every number are chosen here. So is the check of the surfaces beside the edges: a void between the free edge
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
from doorstate.doorways.plan_lines import Flags, Floats, Line, strongest_line
from doorstate.doorways.planes import voxel_downsample
from doorstate.rules.base import Detection, Parameters, Rule, RuleResult
from doorstate.types import DoorState, Indices, Points

_MAX_BREAKS = 4  # of a row in one opening; more are a cluttered room
_MAX_CANDIDATES = 5  # openings of an image
_MIN_ROWS = 10  # of an edge, and of points beside it
_VOXEL_M = 0.02  # points beside an edge within it count once
_NOT_OPEN = "not open: this rule does not tell closed from semi-open"


class OpenDoorParameters(Parameters):
    """Parameters of the open-door rule; the authors' values are not published."""

    unmeasured_run_px: int = Field(default=4, ge=1)  # chosen: single dropouts are no opening
    behind_m: float = Field(default=0.3, gt=0)  # chosen: more than a wall is thick
    # Chosen: a leaf hides a part of its opening, or its free edge, which stands off the wall, ends the run.
    run_width_m: tuple[float, float] = (0.3, 1.6)
    # Published: dimensions are checked. Chosen: single doors and frames of many countries; edges as far as in view.
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
    """Ends of the runs of one opening, over rows, as indices (K,) of measured points."""

    left: Indices
    right: Indices


@dataclass(frozen=True, eq=False)
class _Scan:
    """Measured points, row by row from left to right."""

    points: Floats  # (M, 3) metres
    row: Indices  # (M,)
    segment: Indices  # (M,) number of the part of its row, without a jump, that a point belongs to
    breaks: Indices  # points after which another segment of the same row follows
    unmeasured: Flags  # by break: nothing was measured between its two points


@dataclass(frozen=True, eq=False)
class _Side:
    """Upright surface beside an edge."""

    line: Line
    has_extent: bool  # False: only the edge itself, such as a leaf seen edge-on


class OpenDoorRule(Rule[OpenDoorParameters]):
    """Open or not open, from an organized cloud.

    Source: Kaleci & Turgut 2020, reconstructed from the publication.
    """

    name = "open_door"
    source = "Kaleci & Turgut 2020 (a reconstruction, not the authors' code)"
    defaults = OpenDoorParameters

    def __call__(self, cloud: Points) -> RuleResult:
        if cloud.ndim != 3:
            return RuleResult.abstain(
                "needs an organized cloud (H, W, 3): an opening is a run of unmeasured readings"
            )
        scan = self._scan(cloud)
        if not len(scan.points):
            return RuleResult.abstain("nothing was measured")
        for edges in self._chains(scan, self._runs(scan)):
            ends = scan.points[edges.left], scan.points[edges.right]
            corners = self._corners(scan, edges) if self._are_door_edges(ends) else None
            if corners is not None:
                return _open_result(ends, corners)
        return RuleResult(None, _NOT_OPEN, open_or_not=False)

    def _scan(self, cloud: Points) -> _Scan:
        flat = np.asarray(cloud).reshape(-1, 3)
        pixels = np.flatnonzero(is_measured(flat))
        points = flat[pixels].astype(np.float64)
        row, column = np.divmod(pixels, cloud.shape[1])
        same_row = np.diff(row) == 0
        unmeasured = np.diff(column) > self.parameters.unmeasured_run_px
        jumps = np.abs(np.diff(np.hypot(points[:, 0], points[:, 1]))) > self.parameters.behind_m
        segment = np.zeros(len(points), dtype=np.int64)
        segment[1:] = np.cumsum(unmeasured | jumps | ~same_row)
        breaks = np.flatnonzero(same_row & (unmeasured | jumps))
        return _Scan(points, row, segment, breaks, unmeasured[breaks])

    def _runs(self, scan: _Scan) -> _Edges:
        """Return the ends of all runs of a row that are unmeasured or far behind throughout, of suitable width."""
        points, breaks = scan.points, scan.breaks
        low, high = self.parameters.run_width_m
        lefts, rights = [], []
        for num_inner in range(_MAX_BREAKS):
            start = np.arange(len(breaks) - num_inner)
            left, right = breaks[start], breaks[start + num_inner] + 1
            same_row = scan.row[left] == scan.row[right]
            start, left, right = start[same_row], left[same_row], right[same_row]
            width_m = np.hypot(*(points[left] - points[right])[:, :2].T)
            kept = (low <= width_m) & (width_m <= high)
            start, left, right = start[kept], left[kept], right[kept]
            void = scan.unmeasured[start] if num_inner == 0 else np.ones(len(start), dtype=bool)
            for inner in range(num_inner):
                # A segment has no jump, so that its ends represent all of it.
                for end in (breaks[start + inner] + 1, breaks[start + inner + 1]):
                    void &= _beyond_m(points[end], points[left], points[right]) > self.parameters.behind_m
            lefts.append(left[void])
            rights.append(right[void])
        return _Edges(np.concatenate(lefts), np.concatenate(rights))

    def _chains(self, scan: _Scan, runs: _Edges) -> Iterator[_Edges]:
        """Yield runs at the same place in plan view, those of most rows first."""
        ends = np.hstack([scan.points[runs.left, :2], scan.points[runs.right, :2]])
        rest = np.arange(len(ends))
        for _ in range(_MAX_CANDIDATES):
            if len(rest) < _MIN_ROWS:
                return
            tree = cKDTree(ends[rest])
            counts = tree.query_ball_point(ends[rest], self.parameters.chain_m, return_length=True)
            chain = tree.query_ball_point(ends[rest[np.argmax(counts)]], self.parameters.chain_m)
            if len(chain) >= _MIN_ROWS:
                yield _Edges(runs.left[rest[chain]], runs.right[rest[chain]])
            rest = np.delete(rest, chain)

    def _are_door_edges(self, ends: tuple[Floats, Floats]) -> bool:
        """Return True if two edges are as high, plumb, straight and parallel as those of a door."""
        p = self.parameters
        low, high = p.edge_height_m
        slopes = []
        for edge in ends:
            height_m = edge[:, 2] - edge[:, 2].mean()
            if not low <= np.ptp(height_m) <= high:
                return False
            design = np.stack([np.ones(len(edge)), height_m], axis=1)
            fit, *_ = np.linalg.lstsq(design, edge[:, :2], rcond=None)
            if np.square(edge[:, :2] - design @ fit).sum(axis=1).mean() > p.edge_rms_m**2:
                return False
            slopes.append(fit[1])
        steepest = np.tan(np.radians(p.edge_tilt_deg))
        return all(np.hypot(*slope) <= steepest for slope in (*slopes, slopes[0] - slopes[1]))

    def _corners(self, scan: _Scan, edges: _Edges) -> Floats | None:
        """Return the corners (2, 2) of the opening in plan view, left and right; None if there is no opening."""
        low_m, high_m = self.parameters.door_width_m
        places = [np.median(scan.points[edge, :2], axis=0) for edge in edges]
        sides = [self._side(scan, edge, place) for edge, place in zip(edges, places, strict=True)]
        for near_side, far_side in ((0, 1), (1, 0)):
            wall, beside = sides[near_side], sides[far_side]
            if wall is None or beside is None or not wall.has_extent:
                continue
            near = wall.line.foot(places[near_side])
            far = self._far_corner(wall.line, near, places[near_side], beside, places[far_side])
            if far is not None and low_m <= float(np.hypot(*(near - far))) <= high_m:
                return np.stack([near, far] if near_side == 0 else [far, near])
        return None

    def _side(self, scan: _Scan, edge: Indices, place: Floats) -> _Side | None:
        """Return the surface that ends at an edge; None if it is no upright plane."""
        p = self.parameters
        is_edge_segment = np.zeros(scan.segment[-1] + 1, dtype=bool)
        is_edge_segment[scan.segment[edge]] = True
        points = scan.points[is_edge_segment[scan.segment], :2]
        reach_m = np.hypot(*(points - place).T)
        ring = points[(reach_m > p.support_ring_m[0]) & (reach_m < p.support_ring_m[1])]
        if len(ring) < _MIN_ROWS:
            return _Side(Line(place, place / np.hypot(*place)), has_extent=False)
        # Every place counts once: more pixels see a reveal head-on than a wall at a slant.
        places = voxel_downsample(ring, _VOXEL_M)
        fit = strongest_line(places, p.support_m)
        if fit is None:
            return None
        line, on_line = fit
        long_enough = np.ptp(line.along_m(places[on_line])) >= p.support_length_m
        return _Side(line, has_extent=True) if long_enough and on_line.mean() >= p.support_share else None

    def _far_corner(
        self, wall: Line, near: Floats, edge: Floats, beside: _Side, other_edge: Floats
    ) -> Floats | None:
        """Return the other corner (2,) of an opening in a wall; None if it is not the opening of an open door."""
        p = self.parameters
        off_m = np.abs(wall.behind_m(np.stack([edge, other_edge])))
        if off_m[0] > p.wall_depth_m:
            return None
        if wall.angle_deg(beside.line) <= p.same_wall_deg:
            coplanar = beside.has_extent and off_m[1] <= p.wall_depth_m
            return wall.foot(other_edge) if coplanar else None
        # A leaf ends at its edge; edge-on, it stands off the wall.
        reach_m = abs(float(beside.line.behind_m(other_edge)))
        if reach_m > p.wall_depth_m or (not beside.has_extent and off_m[1] <= p.wall_depth_m):
            return None
        hinge = wall.crossing(beside.line)
        leaf, closed = beside.line.centre - hinge, near - hinge
        # A leaf taken for a wall leads from its free edge back to the hinge, a wall away from it.
        leads_away = float((wall.centre - near) @ closed) > 0
        cosine = leaf @ closed / (np.hypot(*leaf) * np.hypot(*closed))
        return hinge if leads_away and cosine <= np.cos(np.radians(p.open_leaf_deg)) else None


def _beyond_m(points: Floats, left: Floats, right: Floats) -> Floats:
    """Return the distances (K,) of points (K, 3) behind the lines from left to right in plan view."""
    along = right[:, :2] - left[:, :2]
    normal = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.hypot(*along.T)[:, None]
    normal *= np.sign((normal * left[:, :2]).sum(axis=1, keepdims=True))
    beyond: Floats = (normal * (points - left)[:, :2]).sum(axis=1)
    return beyond


def _open_result(ends: tuple[Floats, Floats], corners: Floats) -> RuleResult:
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
