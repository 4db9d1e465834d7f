# SPDX-License-Identifier: Apache-2.0
"""Prepared clouds in the units and axes of the networks."""

from __future__ import annotations

import numpy as np

from doorstate.types import Points

SCALE_M = 3.0  # half the depth of a typical frame: networks were designed for clouds of about unit radius


def normalize(points: Points) -> Points:
    """Centre clouds on their centroid and divide them by 3 m, which keeps the size of the door as a cue.

    Args:
        points: (..., N, 3) metres.

    Returns:
        The same shape, float32, without unit.
    """
    normalized: Points = (points - centroids(points)[..., None, :]) / np.float32(SCALE_M)
    return normalized


def centroids(points: Points) -> Points:
    """Return the centroids (..., 3) of clouds (..., N, 3), in metres."""
    mean: Points = points.mean(axis=-2, dtype=np.float64).astype(np.float32)
    return mean
