# SPDX-License-Identifier: Apache-2.0
"""Measured and missing points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate.types import MAX_COORDINATE


def is_measured(points: NDArray[np.floating[Any]]) -> NDArray[np.bool_]:
    """Return a mask (...) of the points (..., 3) that are not NaN, infinite, larger than any room, or (0, 0, 0)."""
    with np.errstate(invalid="ignore"):  # comparing a signalling NaN, as some drivers write, is "invalid"
        x, y, z = (np.abs(points[..., axis]) for axis in range(3))
        largest = np.maximum(np.maximum(x, y), z)  # NaN if one of them is, which is not below the limit
        mask: NDArray[np.bool_] = (largest < MAX_COORDINATE) & (largest > 0)
    return mask


def quiet_nans(points: NDArray[Any]) -> NDArray[Any]:
    """Return numbers with quiet NaNs in place of signalling ones, which make every later step warn."""
    if points.dtype.kind != "f":
        return points
    try:
        with np.errstate(invalid="raise", over="ignore"):
            points.sum()
    except FloatingPointError:  # a signalling NaN, or infinity of both signs
        with np.errstate(invalid="ignore"):
            return np.asarray(points * points.dtype.type(1))
    return points
