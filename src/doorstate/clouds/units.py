# SPDX-License-Identifier: Apache-2.0
"""Check that coordinates can be metres."""

from __future__ import annotations

import numpy as np

from doorstate.errors import CloudContentError
from doorstate.types import UNITS_M, Points

# No depth camera measures farther; clouds in millimetres have medians in the thousands.
_MAX_MEDIAN_M = 50.0
_MIN_MEDIAN_M = 0.02
_LIKELY_MEDIAN_M = (0.8, 8.0)  # less than a factor of ten, so that at most one unit fits
_SAMPLE_SIZE = 4096


def median_range_m(points: Points) -> float:
    """Return the median distance of points (N, 3) from the camera, from a sample of large clouds."""
    sample = points[:: max(1, len(points) // _SAMPLE_SIZE)].astype(np.float64)
    return float(np.median(np.linalg.norm(sample, axis=1)))


def check_units(points: Points) -> None:
    """Check that measured points (N, 3) can be metres.

    Raises:
        CloudContentError: their median distance is impossible; suggests the unit that would fit a door.
    """
    median_m = median_range_m(points)
    if median_m > _MAX_MEDIAN_M:
        problem = f"half of the points are more than {median_m:.0f} m away"
    elif median_m < _MIN_MEDIAN_M:
        problem = f"half of the points are within {median_m * 1000:.2g} mm of the camera"
    else:
        return
    smallest_m, largest_m = _LIKELY_MEDIAN_M
    for units_m in UNITS_M.values():
        if smallest_m <= median_m * units_m <= largest_m:
            factor = f"{1 / units_m:g} times too far" if units_m < 1 else f"{units_m:g} times too near"
            raise CloudContentError(f"{problem}, {factor} for a door", suggestions={"units_m": units_m})
    raise CloudContentError(problem, expected="metres")
