# SPDX-License-Identifier: Apache-2.0
"""Cloud around a doorway in the doorway's frame. Training, export and prediction share it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.clouds.coordinates import coordinates
from doorstate.clouds.measured import is_measured
from doorstate.clouds.preparation import (
    MAX_NUM_POINTS,
    MIN_POINTS,
    PreparedCloud,
    distinct_farthest_points,
    too_few_points,
)
from doorstate.clouds.samplers import Sampler
from doorstate.clouds.thinning import CELLS_PER_POINT, thinned_points
from doorstate.doorways.doorway import Doorway
from doorstate.doorways.small_holes import fill_small_holes
from doorstate.types import Indices, Points

CROP_POINTS = 1024
_PIXELS_PER_POINT = 6  # least number of pixels in the box for each sampled point, and at most twice as many
_SEARCH_PIXELS = 16_384  # of an image, in which the box is looked for first
_POINTS_PER_LEAF = 256  # of the sampler's tree: fastest for 1024 of 10,000 points


class CropSpec(FrozenModel):
    """Number of points of a crop, and its box in the doorway's frame.

    Attributes:
        num_points: points to keep.
        half_width_m: along the wall, to both sides of the opening's middle.
        before_m: from the wall towards the camera.
        behind_m: beyond the wall.
        bottom_m: lowest height above the floor.
        top_m: greatest height above the floor.
    """

    num_points: int = Field(default=CROP_POINTS, ge=1, le=MAX_NUM_POINTS)
    half_width_m: float = Field(default=1.5, gt=0)
    before_m: float = Field(default=1.5, gt=0)
    behind_m: float = Field(default=1.5, gt=0)
    bottom_m: float = -0.2
    top_m: float = 2.6

    def contains(self, points: Points) -> NDArray[np.bool_]:
        """Return the mask (...) of the points (..., 3) of the doorway's frame inside the box."""
        x, y, z = points[..., 0], points[..., 1], points[..., 2]
        inside: NDArray[np.bool_] = (np.abs(x) <= self.half_width_m) & (y <= self.before_m)
        inside &= (y >= -self.behind_m) & (z >= self.bottom_m) & (z <= self.top_m)
        return inside


DEFAULT_CROP = CropSpec()


def crop_cloud(
    cloud: Points, doorway: Doorway, spec: CropSpec = DEFAULT_CROP, sampler: Sampler | None = None
) -> PreparedCloud:
    """Return the points around a doorway, in its frame and in farthest-point order, each distinct point once.

    They are sampled from some of the points in the box: of an image from every second, third, ... row and column,
    at least 6 pixels for each point, and of a flat cloud from one point in each cell of a grid.
    Holes of at most 0.2 m are filled where the surface around them is one plane; such points have the row of the
    measured point nearest to them.

    Args:
        cloud: (N, 3) or organized (H, W, 3) metres, level sensor frame, without outliers; NaN, infinite or (0, 0, 0)
            where nothing was measured.
        doorway: pose of the doorway.
        spec: number of points, and limits.
        sampler: implementation of farthest point sampling; None: `choose_sampler()`.

    Raises:
        TooFewPointsError: fewer than 128 distinct points are inside.
    """
    if cloud.ndim == 3:
        rows, points = _inside_of_image(cloud, doorway, spec)
    else:
        rows, points = _inside(cloud, doorway, spec)
        kept = thinned_points(points, CELLS_PER_POINT * spec.num_points)
        rows, points = rows[kept], points[kept]
    filling = fill_small_holes(points, doorway.to_doorway(np.zeros(3, np.float32)))
    if len(filling.points):
        points = np.concatenate([points, filling.points])
        rows = np.concatenate([rows, rows[filling.nearest]])
    least = min(spec.num_points, MIN_POINTS)
    if len(points) < least:
        raise too_few_points(f"{len(points)} measured around the doorway")
    sampled = distinct_farthest_points(points, spec.num_points, sampler, _POINTS_PER_LEAF)
    if len(sampled) < least:
        raise too_few_points(f"{len(sampled)} distinct of {len(points)} measured around the doorway")
    return PreparedCloud(np.ascontiguousarray(points[sampled]), rows[sampled])


def _inside(flat: Points, doorway: Doorway, spec: CropSpec) -> tuple[Indices, Points]:
    """Return the rows (n,) of the points (N, 3) in the box, and these points (n, 3) in the doorway's frame."""
    with np.errstate(invalid="ignore", over="ignore"):  # infinite, or as large as some drivers write
        points = doorway.to_doorway(np.asarray(flat, dtype=np.float32))
        rows = np.flatnonzero(spec.contains(points) & is_measured(flat))
    return rows, points.T.take(rows, axis=1).T


def _inside_of_image(image: Points, doorway: Doorway, spec: CropSpec) -> tuple[Indices, Points]:
    """Return the same of an image (H, W, 3), thinned. The rows are those of the flattened image."""
    height, width, _ = image.shape
    # An odd step meets images in which every second row or column is missing.
    step = int(np.sqrt(height * width / _SEARCH_PIXELS)) | 1
    everywhere = _Grid(slice(0, height, step), slice(0, width, step))
    rows, points = _inside_of_grid(image, everywhere, doorway, spec)
    if len(rows) == 0:
        return rows, points
    window = (_around(rows // width, step, height), _around(rows % width, step, width))
    ratio = max(1.0, len(rows) * step**2 / (_PIXELS_PER_POINT * spec.num_points))
    down = int(np.sqrt(ratio))
    across = min(int(ratio / down), down + 1)
    grid = _Grid(*(slice(side.start, side.stop, by) for side, by in zip(window, (down, across), strict=True)))
    rows, points = _inside_of_grid(image, grid, doorway, spec)
    if len(rows) < spec.num_points:  # an even step may meet missing ones only
        rows, points = _inside_of_grid(image, _Grid(*window), doorway, spec)
    return rows, points


class _Grid(NamedTuple):
    """Rows and columns of an image."""

    rows: slice
    columns: slice


def _inside_of_grid(image: Points, grid: _Grid, doorway: Doorway, spec: CropSpec) -> tuple[Indices, Points]:
    """Return the same of some rows and columns of an image."""
    height, width, _ = image.shape
    pixels = np.arange(height)[grid.rows, None] * width + np.arange(width)[grid.columns]
    rows, points = _inside(coordinates(image[grid]).T, doorway, spec)
    return pixels.reshape(-1)[rows], points


def _around(places: Indices, step: int, size: int) -> slice:
    """Return the range of places in steps, with a step more at both ends."""
    return slice(max(0, int(places.min()) - step), min(size, int(places.max()) + 2 * step))
