# SPDX-License-Identifier: Apache-2.0
"""Measured and missing points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

MAX_COORDINATE = 1e6  # in any unit; some drivers write FLT_MAX where nothing was measured


def is_measured(points: NDArray[np.floating[Any]]) -> NDArray[np.bool_]:
    """Return a mask (...) of the points (..., 3) that are not NaN, infinite, larger than any room, or (0, 0, 0)."""
    x, y, z = (np.abs(points[..., axis]) for axis in range(3))
    in_range = (x < MAX_COORDINATE) & (y < MAX_COORDINATE) & (z < MAX_COORDINATE)
    mask: NDArray[np.bool_] = in_range & ((x > 0) | (y > 0) | (z > 0))
    return mask
