# SPDX-License-Identifier: Apache-2.0
"""Vertical planes as walls: covered length, outline, and the state of a wall without a visible leaf."""

from __future__ import annotations

import itertools
import math

import numpy as np

from doorstate.clouds.floor import lowest_z_m
from doorstate.doorways.plan_lines import Flags, Floats
from doorstate.doorways.planes import Plane
from doorstate.rules.base import Detection, Parameters, RuleResult, measured_points
from doorstate.types import DoorState, Points


class WallParameters(Parameters):
    """Tolerances and sizes of a wall without a visible leaf."""

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


def state_without_leaf(wall: Plane, points: Floats, parameters: WallParameters) -> RuleResult:
    """Return the state of a wall in which no leaf was detected.

    Open where it has a door-wide void between two stretches of wall, something was measured through it, and nothing
    stands before it; closed where it is unbroken over more than a door's width in the middle of the view (a door flush
    with its wall looks like the bare wall); else no state.

    Args:
        wall: plane of the wall.
        points: (N, 3) metres, all of the cloud.
        parameters: tolerances and sizes.
    """
    p = parameters
    below_lintel = points[:, 2] < p.low_m
    behind_m = wall.distances_m(points)
    along = _along(wall)
    off_ground = above_floor(points, p.floor_margin_m)
    on_wall = points[below_lintel & off_ground & (np.abs(behind_m) <= p.threshold_m)]
    if len(on_wall) == 0:
        return RuleResult.abstain("no wall at the camera's height")
    detection = outline("wall", wall, on_wall)
    start_m = float((on_wall @ along).min())
    solid = _filled_bins(on_wall @ along - start_m, p.bin_m)
    # Intersections of the wall with the sight lines to points behind it and before it.
    crossing_m = (points @ along) * wall.offset_m / np.maximum(points @ wall.normal, 1e-6) - start_m
    crosses = (crossing_m >= 0) & (crossing_m < len(solid) * p.bin_m) & below_lintel
    seen_through = _filled_bins(crossing_m[crosses & (behind_m > p.behind_m)], p.bin_m, len(solid))
    # A leaf seen from its edge, most of all: it may stand at any angle.
    obstructed = _filled_bins(
        crossing_m[crosses & off_ground & (behind_m < -p.behind_m)], p.bin_m, len(solid)
    )
    covered = np.flatnonzero(solid)
    for last, first in itertools.pairwise(covered):
        width_m = float(first - last - 1) * p.bin_m
        if not p.opening_width_m[0] <= width_m <= p.opening_width_m[1]:
            continue
        if obstructed[last : first + 1].any():
            return RuleResult.abstain("something stands before the opening", detection)
        if seen_through[last + 1 : first].mean() >= p.seen_through_share:
            edges_m = [start_m + (last + 1) * p.bin_m, start_m + first * p.bin_m]
            opening = Detection(
                "opening", np.stack([wall.normal * wall.offset_m + along * edge_m for edge_m in edges_m])
            )
            return RuleResult(DoorState.OPEN, opening_width_m=width_m, detections=(detection, opening))
    bin_centres = wall.normal * wall.offset_m + along * (start_m + (covered[:, None] + 0.5) * p.bin_m)
    ahead = np.abs(np.arctan2(bin_centres[:, 1], bin_centres[:, 0])) <= math.radians(p.middle_deg)
    hole_ends = np.flatnonzero(np.diff(covered) * p.bin_m > p.largest_hole_m) + 1
    for stretch in np.split(np.arange(len(covered)), hole_ends):
        if ahead[stretch].any() and len(stretch) * p.bin_m >= p.unbroken_m:
            return RuleResult(DoorState.CLOSED, opening_angle_deg=0.0, detections=(detection,))
    return RuleResult.abstain(
        "one plane, neither unbroken in the middle nor with a void to see through", detection
    )


def nearby_points(cloud: Points, farthest_m: float) -> tuple[Floats, float]:
    """Return (M, 3) measured points of every other pixel within a range, and the measured share of these pixels.

    The share is taken before the range; for a flat cloud it is 1.
    """
    coarse = cloud[::2, ::2] if cloud.ndim == 3 else cloud
    points = measured_points(coarse)
    pixels = coarse.size / 3 if coarse.ndim == 3 else 0
    share = len(points) / pixels if pixels else 1.0
    return points[np.abs(points).max(axis=1) < farthest_m], share


def above_floor(points: Floats, margin_m: float) -> Flags:
    """Return a mask of the (N, 3) points that are higher than the lowest by more than a margin."""
    mask: Flags = points[:, 2] > lowest_z_m(points) + margin_m
    return mask


def covered_length_m(plane: Plane, on_plane: Floats, bin_m: float) -> float:
    """Return the length along a vertical plane on which (N, 3) points lie, without holes."""
    position_m = on_plane @ _along(plane)
    return float(_filled_bins(position_m - position_m.min(), bin_m).sum()) * bin_m


def outline(name: str, plane: Plane, on_plane: Floats) -> Detection:
    """Return the upright rectangle (4 corners) around (N, 3) points of a vertical plane."""
    along = _along(plane)
    left, right = np.quantile(on_plane @ along, (0.01, 0.99))
    foot = plane.normal * plane.offset_m
    low, high = on_plane[:, 2].min(), on_plane[:, 2].max()
    corners = ((left, low), (right, low), (right, high), (left, high))
    return Detection(name, np.array([foot + along * side + [0.0, 0.0, height] for side, height in corners]))


def _along(plane: Plane) -> Floats:
    return np.array([-plane.normal[1], plane.normal[0], 0.0])


def _filled_bins(positions_m: Floats, bin_m: float, num_bins: int = 0) -> Flags:
    """Return a mask of the bins with at least two points."""
    filled: Flags = np.bincount((positions_m / bin_m).astype(np.int64), minlength=num_bins) >= 2
    return filled
