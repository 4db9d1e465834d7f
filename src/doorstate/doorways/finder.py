# SPDX-License-Identifier: Apache-2.0
"""Candidate doorways of a level cloud: walls, their elevations, and the likeliest columns of each."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.clouds.coordinates import coordinates
from doorstate.clouds.floor import lowest_z_m
from doorstate.clouds.measured import is_measured
from doorstate.doorways.column_scorer import ColumnScores, score_columns
from doorstate.doorways.doorway import Doorway, gap
from doorstate.doorways.elevation import COLUMN_M, Elevation, SightLines, wall_elevation
from doorstate.doorways.plan_lines import Floats
from doorstate.doorways.walls import Wall, find_walls
from doorstate.types import Points

_MAX_POINTS = 40_000
_UPRIGHT_M = (0.15, 2.2)  # heights above the floor without floor, skirting boards and ceiling
_PEAK_M = 0.3  # a column is a peak if none so near scores higher
_SNAP_M, _MIN_END = 0.2, 0.3  # of an edge from the end that a column proposes, and its least probability
_SAME_M, _SAME_DEG = 0.3, 20.0  # candidates of two walls that are one doorway


class FinderSettings(FrozenModel):
    """Limits of the finder.

    Attributes:
        most: candidates of a cloud.
        min_score: least probability of a candidate.
        width_m: least and largest width.
    """

    most: int = Field(default=8, ge=1, le=100)
    min_score: float = Field(default=0.15, ge=0, le=1)
    width_m: tuple[float, float] = (0.6, 2.4)


DEFAULT_FINDER = FinderSettings()


def find_doorways(
    cloud: Points, floor_z_m: float | None = None, settings: FinderSettings = DEFAULT_FINDER
) -> list[Doorway]:
    """Return the candidate doorways of a cloud, the likeliest first.

    Args:
        cloud: (N, 3) or organized (H, W, 3) metres, level sensor frame, NaN where nothing was measured.
        floor_z_m: height of the floor; None takes that of the lowest points.
        settings: limits.
    """
    points = thinned(cloud)
    if len(points) == 0:
        return []
    floor_m = lowest_z_m(points) if floor_z_m is None else floor_z_m
    found = [
        doorway
        for wall, elevation in _survey(points, floor_m)
        for doorway in _on_wall(wall, elevation, floor_m, settings)
    ]
    distinct: list[Doorway] = []
    for doorway in sorted(found, key=lambda candidate: -candidate.score):
        if not any(_are_one(doorway, better) for better in distinct):
            distinct.append(doorway)
    return distinct[: settings.most]


def surveyed_walls(cloud: Points, floor_z_m: float) -> list[tuple[Wall, Elevation]]:
    """Return the walls of a cloud with their elevations; arguments are those of `find_doorways`."""
    points = thinned(cloud)
    return _survey(points, floor_z_m) if len(points) else []


def thinned(cloud: Points) -> NDArray[np.float32]:
    """Return measured points (N, 3) of some rows and columns of an image, or of some points of a flat cloud."""
    if cloud.ndim == 3:
        step = math.ceil(math.sqrt(cloud.size / 3 / _MAX_POINTS))
        cloud = coordinates(cloud[::step, ::step]).T
    rows = np.flatnonzero(is_measured(cloud))
    rows = rows[:: max(1, len(rows) // _MAX_POINTS)]
    return cloud.T.take(rows, axis=1).astype(np.float32, copy=False).T


def _survey(points: NDArray[np.float32], floor_m: float) -> list[tuple[Wall, Elevation]]:
    height_m = points[:, 2] - np.float32(floor_m)
    rows = np.flatnonzero((height_m > _UPRIGHT_M[0]) & (height_m < _UPRIGHT_M[1]))
    upright = points.T.take(rows, axis=1).astype(np.float64).T
    lines = SightLines.to(points)
    return [(wall, wall_elevation(wall, lines, floor_m)) for wall in find_walls(upright)]


def _on_wall(wall: Wall, elevation: Elevation, floor_m: float, settings: FinderSettings) -> Iterator[Doorway]:
    scores = score_columns(elevation, wall.distance_m)
    for peak in _peaks(scores.middles.probability, settings.min_score):
        right_m, left_m = _ends(scores, peak)
        middle_m, width_m = (right_m + left_m) / 2, float(np.clip(left_m - right_m, *settings.width_m))
        x_m, y_m = wall.line.at(middle_m) + wall.line.normal * scores.behind_m[peak]
        yield Doorway(
            x_m=float(x_m),
            y_m=float(y_m),
            yaw_deg=wall.yaw_deg,
            width_m=width_m,
            floor_z_m=floor_m,
            score=float(scores.middles.probability[peak]),
        )


def _ends(scores: ColumnScores, peak: int) -> tuple[float, float]:
    """Return the right and left end of the doorway of a column: visible edges, where there are, else by its width."""
    middle_m, half_m = scores.middles.along_m[peak], scores.width_m[peak] / 2
    proposed = [float(middle_m - half_m), float(middle_m + half_m)]
    snapped: list[float | None] = []
    for places, end_m in zip(scores.ends, proposed, strict=True):
        weight = places.probability * np.exp(-(((places.along_m - end_m) / _SNAP_M) ** 2))
        best = int(weight.argmax())
        snapped.append(float(places.along_m[best]) if weight[best] >= _MIN_END else None)
    right_m, left_m = snapped
    if right_m is not None and left_m is not None:
        return right_m, left_m
    if right_m is not None:
        return right_m, right_m + 2 * float(half_m)
    if left_m is not None:
        return left_m - 2 * float(half_m), left_m
    return proposed[0], proposed[1]


def _peaks(probability: Floats, min_score: float) -> list[int]:
    """Return the columns with the highest score of their surroundings."""
    reach = round(_PEAK_M / COLUMN_M)
    padded = np.pad(probability, reach)
    highest = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).max(axis=1)
    peaks: list[int] = np.flatnonzero((probability == highest) & (probability >= min_score)).tolist()
    return peaks


def _are_one(first: Doorway, second: Doorway) -> bool:
    distance_m, turn_deg = gap(first, second)
    # The two faces of a thin wall differ by half a turn.
    return distance_m <= _SAME_M and min(turn_deg, 180 - turn_deg) <= _SAME_DEG
