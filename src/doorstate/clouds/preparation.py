# SPDX-License-Identifier: Apache-2.0
"""The one path from raw points to a network's input: clean, check, order, normalise."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from doorstate.clouds.sampling import farthest_point_indices
from doorstate.errors import CloudContentError
from doorstate.types import Indices, Points

NUM_POINTS = 4096  # the paper's cloud size
MIN_POINTS = 128  # fewer cannot fill the largest neighbourhood of a network
SCALE_M = 3.0  # half the depth of a typical frame: networks were designed for clouds of about unit radius
_LARGEST_MEDIAN_M = 50.0  # no depth camera reaches this far; a cloud in millimetres has medians in the thousands
_SMALLEST_MEDIAN_M = 0.02


class PreparedCloud(NamedTuple):
    """Points in farthest-point order and the rows of the raw cloud they came from."""

    points: Points  # (n, 3) metres
    indices: Indices  # (n,)


def prepare_cloud(points: Points, count: int = NUM_POINTS) -> PreparedCloud:
    """Drop unmeasured points, check what is left, and keep `count` points in farthest-point order.

    A cloud with fewer than `count` measured points gives all of them, each once; points are never repeated.

    Args:
        points: (N, 3) or organized (H, W, 3) metres, NaN or infinite where nothing was measured.
        count: how many points to keep.

    Raises:
        CloudContentError: empty, nothing measured, too few points, or units that cannot be metres.
    """
    flat = np.asarray(points, dtype=np.float32).reshape(-1, 3)
    if len(flat) == 0:
        raise CloudContentError("the cloud is empty: it holds no points")
    measured = np.flatnonzero(np.isfinite(flat).all(axis=1))
    if len(measured) == 0:
        raise CloudContentError(f"none of the {len(flat)} points was measured: all are NaN or infinite")
    clean = flat[measured]
    if not clean.any():
        raise CloudContentError(f"all {len(clean)} measured points lie at the origin: the cloud holds no surface")
    if len(clean) < MIN_POINTS:
        raise CloudContentError(f"too few points: {len(clean)} measured, at least {MIN_POINTS} are needed")
    _check_units(clean)
    chosen = farthest_point_indices(clean, min(count, len(clean)))
    return PreparedCloud(clean[chosen], measured[chosen])


def normalize(points: Points) -> Points:
    """Centre clouds on their centroid and divide by 3 m, so that the door keeps its size as a cue.

    Args:
        points: (..., N, 3) metres.

    Returns:
        The same shape, float32, without unit.
    """
    centroid = points.mean(axis=-2, keepdims=True, dtype=np.float64).astype(np.float32)
    return (points - centroid) / np.float32(SCALE_M)


def _check_units(points: Points) -> None:
    median = float(np.median(np.linalg.norm(points.astype(np.float64), axis=1)))
    if median > _LARGEST_MEDIAN_M:
        raise CloudContentError(
            f"half of the points are more than {median:.0f} m away: millimetres? say --units mm"
        )
    if median < _SMALLEST_MEDIAN_M:
        raise CloudContentError(
            f"half of the points are within {median * 1000:.2g} mm of the camera: kilometres? say --units km"
        )
