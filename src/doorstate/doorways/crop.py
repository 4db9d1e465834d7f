# SPDX-License-Identifier: Apache-2.0
"""Cloud around a doorway in the doorway's frame. Training, export and prediction share it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.clouds.measured import is_measured
from doorstate.clouds.preparation import (
    MAX_NUM_POINTS,
    MIN_POINTS,
    PreparedCloud,
    distinct_farthest_points,
    too_few_points,
)
from doorstate.clouds.samplers import Sampler
from doorstate.clouds.thinning import CELLS_PER_POINT, PIXELS_PER_POINT, thinned_points
from doorstate.doorways.doorway import Doorway
from doorstate.types import Indices, Points

CROP_POINTS = 1024
_FRAME_PIXELS_PER_POINT = 64  # of a whole image; a doorway 3 m away and its surroundings cover a quarter of it
_FEW_PIXELS_PER_POINT = 4  # a crop with fewer is taken from all pixels


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

    They are sampled from every second, third, ... row and column of an image, and from one point in each cell of a
    grid of a flat cloud, as long as 16 or 8 times `spec.num_points` remain.

    Args:
        cloud: (N, 3) or organized (H, W, 3) metres, level sensor frame, without outliers; NaN, infinite or (0, 0, 0)
            where nothing was measured.
        doorway: pose of the doorway.
        spec: number of points, and limits.
        sampler: implementation of farthest point sampling; None: `choose_sampler()`.

    Raises:
        TooFewPointsError: fewer than 128 distinct points are inside.
    """
    rows, points = _inside_of_image(cloud, doorway, spec) if cloud.ndim == 3 else _inside(cloud, doorway, spec)
    if cloud.ndim == 2:
        kept = thinned_points(points, CELLS_PER_POINT * spec.num_points)
        rows, points = rows[kept], points[kept]
    least = min(spec.num_points, MIN_POINTS)
    if len(points) < least:
        raise too_few_points(f"{len(points)} measured around the doorway")
    sampled = distinct_farthest_points(points, spec.num_points, sampler)
    if len(sampled) < least:
        raise too_few_points(f"{len(sampled)} distinct of {len(points)} measured around the doorway")
    return PreparedCloud(points[sampled], rows[sampled])


def _inside(flat: Points, doorway: Doorway, spec: CropSpec) -> tuple[Indices, Points]:
    """Return the rows (n,) of the points (N, 3) in the box, and these points (n, 3) in the doorway's frame."""
    with np.errstate(invalid="ignore", over="ignore"):  # infinite, or as large as some drivers write
        points = doorway.to_doorway(flat)
        rows = np.flatnonzero(spec.contains(points) & is_measured(flat))
    return rows, np.asarray(points[rows], dtype=np.float32)


def _inside_of_image(image: Points, doorway: Doorway, spec: CropSpec) -> tuple[Indices, Points]:
    """Return the same of an image (H, W, 3), thinned."""
    height, width, _ = image.shape
    step = max(1, int(np.sqrt(height * width / (_FRAME_PIXELS_PER_POINT * spec.num_points))))
    rows, points = _inside_of_grid(image, doorway, spec, step)
    if step > 1 and len(rows) < _FEW_PIXELS_PER_POINT * spec.num_points:
        step = 1
        rows, points = _inside_of_grid(image, doorway, spec, step)
    stride = step * max(1, int(np.sqrt(len(rows) / (PIXELS_PER_POINT * spec.num_points))))
    if stride > step:
        kept = (rows // width % stride == 0) & (rows % width % stride == 0)
        rows, points = rows[kept], points[kept]
    return rows, points


def _inside_of_grid(image: Points, doorway: Doorway, spec: CropSpec, step: int) -> tuple[Indices, Points]:
    """Return the same of every `step`-th row and column of an image."""
    grid = image[::step, ::step]
    rows, points = _inside(grid.reshape(-1, 3), doorway, spec)
    across = grid.shape[1]
    return rows // across * (step * image.shape[1]) + rows % across * step, points
