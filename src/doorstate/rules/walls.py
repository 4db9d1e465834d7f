# SPDX-License-Identifier: Apache-2.0
"""Walls: how far they reach, and what a wall without a visible leaf says of its door."""

from __future__ import annotations

import itertools
import math

import numpy as np

from doorstate.rules.base import Detection, Parameters, RuleResult, measured
from doorstate.rules.plan_lines import Flags, Floats
from doorstate.rules.planes import Plane
from doorstate.types import DoorState, Points


class WallParameters(Parameters):
    """How a wall without a visible leaf is judged."""

    # Chosen: noise of a depth camera at 3 m, and a casing (15 mm) stays in its wall.
    threshold_m: float = 0.03
    # Chosen: pixels 4 m away on a wall seen at 10 degrees are 4 cm apart, every other is used.
    bin_m: float = 0.1
    floor_margin_m: float = 0.15  # above the lowest points; chosen: noise of the floor, skirting boards
    low_m: float = 0.4  # above the camera; chosen: below every lintel for cameras up to 1.5 m
    opening_width_m: tuple[float, float] = (0.6, 1.3)  # chosen: narrowest inner door to widest single door
    behind_m: float = 0.2  # chosen: deeper than the reveal's own points in a thin wall
    seen_through_share: float = 0.5  # chosen: of a void's width, measured behind it; glass measures nothing
    largest_hole_m: float = 0.3  # chosen: a handle's shadow or dropouts, not a way through
    unbroken_m: float = 1.3  # chosen: more than a door; a narrower plane may itself be a leaf
    middle_deg: float = 15.0  # to either side; chosen: half of the narrowest usual view (60 degrees)


def wall_alone(wall: Plane, points: Floats, parameters: WallParameters) -> RuleResult:
    """State of a wall in which no leaf was found.

    Open where it has a door-wide void between two stretches of wall, something was measured through it, and nothing
    stands before it; closed where it is unbroken over more than a door's width in the middle of the view (a door flush
    with its wall cannot be told from the bare wall); else no answer.

    Args:
        wall: its plane.
        points: (N, 3) metres, all of the cloud.
        parameters: sizes.
    """
    p = parameters
    below_lintel = points[:, 2] < p.low_m
    behind_m = wall.distances_m(points)
    along = _along(wall)
    off_ground = off_floor(points, p.floor_margin_m)
    on_wall = points[below_lintel & off_ground & (np.abs(behind_m) <= p.threshold_m)]
    if len(on_wall) == 0:
        return RuleResult.abstain("no wall at the camera's height")
    shape = outline("wall", wall, on_wall)
    start = float((on_wall @ along).min())
    solid = _filled(on_wall @ along - start, p.bin_m)
    # Where the sight lines to what is behind or before the wall cross it.
    crossing = (points @ along) * wall.offset_m / np.maximum(points @ wall.normal, 1e-6) - start
    crosses = (crossing >= 0) & (crossing < len(solid) * p.bin_m) & below_lintel
    seen = _filled(crossing[crosses & (behind_m > p.behind_m)], p.bin_m, len(solid))
    # A leaf seen from its edge, most of all: it may stand at any angle.
    before = _filled(crossing[crosses & off_ground & (behind_m < -p.behind_m)], p.bin_m, len(solid))
    covered = np.flatnonzero(solid)
    for last, first in itertools.pairwise(covered):
        width_m = float(first - last - 1) * p.bin_m
        fits = p.opening_width_m[0] <= width_m <= p.opening_width_m[1]
        if fits and before[last : first + 1].any():
            return RuleResult.abstain("something stands before the opening", shape)
        if fits and seen[last + 1 : first].mean() >= p.seen_through_share:
            edges = [start + (last + 1) * p.bin_m, start + first * p.bin_m]
            opening = Detection(
                "opening", np.stack([wall.normal * wall.offset_m + along * edge for edge in edges])
            )
            return RuleResult(DoorState.OPEN, opening_width_m=width_m, detections=(shape, opening))
    places = wall.normal * wall.offset_m + along * (start + (covered[:, None] + 0.5) * p.bin_m)
    ahead = np.abs(np.arctan2(places[:, 1], places[:, 0])) <= math.radians(p.middle_deg)
    for run in np.split(
        np.arange(len(covered)), np.flatnonzero(np.diff(covered) * p.bin_m > p.largest_hole_m) + 1
    ):
        if ahead[run].any() and len(run) * p.bin_m >= p.unbroken_m:
            return RuleResult(DoorState.CLOSED, opening_angle_deg=0.0, detections=(shape,))
    return RuleResult.abstain(
        "one plane, neither unbroken in the middle nor with a void to see through", shape
    )


def nearby(cloud: Points, farthest_m: float) -> tuple[Floats, float]:
    """(M, 3) measured points of every other pixel within a range, and which share of these pixels was measured.

    The share is taken before the range; of a flat cloud it is 1.
    """
    coarse = cloud[::2, ::2] if cloud.ndim == 3 else cloud
    points = measured(coarse)
    pixels = coarse.size / 3 if coarse.ndim == 3 else 0
    share = len(points) / pixels if pixels else 1.0
    return points[np.abs(points).max(axis=1) < farthest_m], share


def off_floor(points: Floats, margin_m: float) -> Flags:
    """Which (N, 3) points are higher than the lowest by more than a margin."""
    higher: Flags = points[:, 2] > np.quantile(points[:, 2], 0.01) + margin_m
    return higher


def covered_m(plane: Plane, on_plane: Floats, bin_m: float) -> float:
    """Length along a vertical plane on which (N, 3) points lie, without holes."""
    position = on_plane @ _along(plane)
    return float(_filled(position - position.min(), bin_m).sum()) * bin_m


def outline(name: str, plane: Plane, on_plane: Floats) -> Detection:
    """Upright rectangle (4 corners) around (N, 3) points of a vertical plane."""
    along = _along(plane)
    left, right = np.quantile(on_plane @ along, (0.01, 0.99))
    foot = plane.normal * plane.offset_m
    low, high = on_plane[:, 2].min(), on_plane[:, 2].max()
    ends = ((left, low), (right, low), (right, high), (left, high))
    return Detection(name, np.array([foot + along * side + [0.0, 0.0, height] for side, height in ends]))


def _along(plane: Plane) -> Floats:
    return np.array([-plane.normal[1], plane.normal[0], 0.0])


def _filled(positions_m: Floats, bin_m: float, length: int = 0) -> Flags:
    """Bins that hold two points and more."""
    filled: Flags = np.bincount((positions_m / bin_m).astype(np.int64), minlength=length) >= 2
    return filled
