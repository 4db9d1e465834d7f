# SPDX-License-Identifier: Apache-2.0
"""Organized clouds: images of points, told from points in any order by the angles between neighbours."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate.types import MAX_COORDINATE

_MAX_LINES, _MAX_PLACES, _MIN_PAIRS = 8, 32, 12  # sampled to recognize an image
_MIN_SIDE = 16  # of a camera, or rings of a scanner; the order of fewer rows is not doubted


def is_image(cloud: NDArray[Any]) -> bool:
    """Return True if points (H, W, 3) come from the pixels of a camera.

    Rays of neighbouring pixels are closer than rays half an image apart, in rows and in columns. Stacked clouds are
    alike down the columns, or unlike along the rows. Too few measured points count as an image.
    """
    return all(_is_scanned(lines) for lines in (cloud, np.swapaxes(cloud, 0, 1)))


def flatten_unless_image(cloud: NDArray[Any]) -> NDArray[Any]:
    """Return points (H, W, 3) as they are, or as (H * W, 3) if they have been shuffled since they were measured."""
    is_too_small = min(cloud.shape[:2]) < _MIN_SIDE
    return cloud if is_too_small or is_image(cloud) else cloud.reshape(-1, 3)


def _is_scanned(lines: NDArray[Any]) -> bool:
    """Return True if neighbours in a line are closer than points half a line apart."""
    sampled = lines[:: max(1, len(lines) // _MAX_LINES)]
    length = sampled.shape[1]
    places = np.arange(0, length, max(1, length // _MAX_PLACES))

    def median_angle(step: int) -> float:
        """Return the median of 1 - cos of the angle between points `step` places apart."""
        with np.errstate(invalid="ignore", over="ignore"):  # signalling NaNs, infinity
            start, end = (sampled[:, (places + offset) % length].astype(np.float64) for offset in (0, step))
            distances = np.linalg.norm(start, axis=-1), np.linalg.norm(end, axis=-1)
        measured = np.logical_and(*((distance > 0) & (distance < MAX_COORDINATE) for distance in distances))
        if measured.sum() < _MIN_PAIRS:
            return np.nan
        cosines = (start[measured] * end[measured]).sum(axis=1) / (distances[0] * distances[1])[measured]
        return max(0.0, float(np.median(1 - cosines)))

    return not median_angle(1) >= 0.5 * median_angle(length // 2)  # False for NaN
