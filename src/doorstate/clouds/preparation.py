# SPDX-License-Identifier: Apache-2.0
"""Preparation of a raw cloud for a network: clean, check, sample. Training, export and prediction share it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.clouds.measured import is_measured
from doorstate.clouds.outliers import remove_outliers
from doorstate.clouds.samplers import Sampler
from doorstate.clouds.sampling import POINTS_PER_LEAF, farthest_point_indices
from doorstate.clouds.shape import check_shape
from doorstate.clouds.thinning import CELLS_PER_POINT, PIXELS_PER_POINT, thinned_pixels, thinned_points
from doorstate.clouds.units import check_units, median_range_m
from doorstate.errors import TooFewPointsError
from doorstate.types import MAX_COORDINATE, Indices, Points

NUM_POINTS = 4096  # as in the paper
MAX_NUM_POINTS = 1 << 20  # of a prepared cloud: farthest-point order beyond it takes minutes
MIN_POINTS = 128  # fewer cannot fill the largest neighbourhood of a network


class CloudSpec(FrozenModel):
    """Preparation of a cloud: number of points, thinning, depth limit and outliers.

    Attributes:
        num_points: points to keep.
        thin: sample from a part of the points only: every second, third, ... row and column of an organized cloud, one
            point in each cell of a grid of a flat one, as long as 16 or 8 times `num_points` remain. Several times
            faster, and no point moves by more than a few pixels or a cell.
        max_depth_m: drop points farther ahead, along x. Farthest-point sampling spreads over space, so that surfaces
            beyond the training data, such as the end of a corridor, would take most of the points.
        remove_outliers: drop pixels and small blobs that float before or behind every surface (`clouds.outliers`).
            Farthest-point sampling would pick them first.
    """

    num_points: int = Field(default=NUM_POINTS, ge=1, le=MAX_NUM_POINTS)
    thin: bool = False
    max_depth_m: float | None = Field(default=None, gt=0)
    remove_outliers: bool = True


DEFAULT_SPEC = CloudSpec()


class PreparedCloud(NamedTuple):
    """Points in farthest-point order, and their rows in the flattened raw cloud."""

    points: Points  # (n, 3) metres
    indices: Indices  # (n,)


def prepare_cloud(
    points: Points, spec: CloudSpec = DEFAULT_SPEC, sampler: Sampler | None = None
) -> PreparedCloud:
    """Drop unmeasured points, check the rest, and keep `spec.num_points` of them in farthest-point order.

    A cloud with fewer distinct points gives all of them, each once; points are never repeated.

    Args:
        points: (N, 3) or organized (H, W, 3) metres; NaN, infinite, (0, 0, 0) or beyond 1000 km where nothing was
            measured.
        spec: number of points, thinning, depth limit and outliers.
        sampler: implementation of farthest point sampling; all give the same points. None: `choose_sampler()`.

    Raises:
        CloudContentError: another shape, or units that cannot be metres.
        TooFewPointsError: empty, nothing measured, or fewer than 128 distinct points.
    """
    cloud = check_shape(points)
    if spec.remove_outliers:
        cloud = remove_outliers(cloud).points
    rows, clean = _candidates(cloud, spec)
    sampled = distinct_farthest_points(clean, spec.num_points, sampler)
    if len(sampled) < min(spec.num_points, MIN_POINTS):
        raise too_few_points(f"{len(sampled)} distinct of {len(clean)} measured")
    return PreparedCloud(clean[sampled], rows[sampled])


def distinct_farthest_points(
    points: Points, count: int, sampler: Sampler | None = None, points_per_leaf: int = POINTS_PER_LEAF
) -> Indices:
    """Return the indices of at most `count` points (N, 3) in farthest-point order, each distinct point once.

    Arguments are those of `farthest_point_indices`.
    """
    sampled = farthest_point_indices(points, min(count, len(points)), sampler, points_per_leaf)
    # Sampling repeats a point only after all distinct ones, so the repeats are at the end.
    return sampled[: np.count_nonzero(np.bincount(sampled))]


def _candidates(cloud: Points, spec: CloudSpec) -> tuple[Indices, Points]:
    """Return the points to sample from: their rows (n,) in the flattened raw cloud, and themselves (n, 3) float32."""
    flat = cloud.reshape(-1, 3)
    rows = np.arange(len(flat))
    organized = cloud.ndim == 3
    if spec.thin and organized:
        rows = thinned_pixels(cloud.shape[0], cloud.shape[1], PIXELS_PER_POINT * spec.num_points)
        flat = flat[rows]
    flat = np.asarray(flat, dtype=np.float32)
    measured = _measured_rows(flat)
    rows, clean = rows[measured], flat[measured]
    check_units(clean)
    if spec.max_depth_m is not None:
        near = _near_points(clean, spec.max_depth_m)
        rows, clean = rows[near], clean[near]
    if spec.thin and not organized:
        kept = thinned_points(clean, CELLS_PER_POINT * spec.num_points)
        rows, clean = rows[kept], clean[kept]
    return rows, clean


def _measured_rows(flat: Points) -> Indices:
    if len(flat) == 0:
        raise TooFewPointsError("the cloud is empty: it holds no points")
    measured = np.flatnonzero(is_measured(flat))
    if len(measured) == 0:
        if not (np.abs(flat) < MAX_COORDINATE).all(axis=1).any():
            raise TooFewPointsError("nothing was measured: all points are NaN or infinite")
        raise TooFewPointsError("nothing was measured: all points lie at the origin")
    if len(measured) < MIN_POINTS:
        raise too_few_points(f"{len(measured)} measured")
    return measured


def _near_points(clean: Points, max_depth_m: float) -> NDArray[np.bool_]:
    near: NDArray[np.bool_] = clean[:, 0] <= max_depth_m
    if near.sum() < MIN_POINTS:
        median_m = median_range_m(clean)
        raise too_few_points(
            f"{near.sum()} within {max_depth_m:g} m ahead, and half of all more than {median_m:.1f} m away"
        )
    return near


def too_few_points(counts: str) -> TooFewPointsError:
    """Return the error of a cloud that is too small for a network.

    Args:
        counts: what there is, such as "3 measured".
    """
    return TooFewPointsError(f"too few points: {counts}", expected=f"at least {MIN_POINTS}")
