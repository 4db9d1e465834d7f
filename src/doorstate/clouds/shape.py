# SPDX-License-Identifier: Apache-2.0
"""Shapes of clouds: (N, 3), organized (H, W, 3), and batches (B, N, 3) that look like an organized cloud."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.measured import is_measured
from doorstate.errors import CloudContentError
from doorstate.types import Points

_MAX_LINES, _MAX_PLACES, _MIN_PAIRS = 8, 32, 12  # sampled to recognize an image


def check_shape(points: Points) -> Points:
    """Return points as an array, after checking its type and shape.

    Raises:
        CloudContentError: another shape than (N, 3) or (H, W, 3), or no numbers. A fourth value, such as an
            intensity, is refused: reshaping would mix the rows.
    """
    cloud = np.asarray(points)
    if cloud.dtype.kind not in "fiu" or cloud.ndim not in (2, 3) or cloud.shape[-1] != 3:
        has_more_values = cloud.ndim in (2, 3) and 3 < cloud.shape[-1] <= 16
        raise CloudContentError(
            f"{cloud.dtype} of shape {cloud.shape} is not a cloud",
            expected="numbers of shape (N, 3) or (H, W, 3)",
            hint="keep x, y and z only" if has_more_values else None,
        )
    # Limits of coordinates, and squares of coordinates, exceed the range of float16.
    return cloud.astype(np.float32) if cloud.dtype == np.float16 else cloud


def check_single_cloud(points: Points) -> Points:
    """Return one cloud as an array, after checking its shape; an image of one row or column as (N, 3).

    Raises:
        CloudContentError: as `check_shape`, or several clouds (B, N, 3), which would be processed as one image.
    """
    cloud = check_shape(points)
    if cloud.ndim == 3 and 1 in cloud.shape[:2]:
        return cloud.reshape(-1, 3)
    if cloud.ndim == 3 and not is_image(cloud):
        raise CloudContentError(
            f"shape {cloud.shape} is no image: neighbours in a row are as far apart as any two points",
            hint="give several clouds one by one, and points without an order as (N, 3)",
        )
    return cloud


def is_image(cloud: NDArray[Any]) -> bool:
    """Return True if points (H, W, 3) come from the pixels of a camera.

    Rays of neighbouring pixels are closer than rays half an image apart, in rows and in columns. Stacked clouds are
    alike down the columns, or unlike along the rows. Too few measured points count as an image.
    """
    return all(_is_scanned(lines) for lines in (cloud, np.swapaxes(cloud, 0, 1)))


def _is_scanned(lines: NDArray[Any]) -> bool:
    """Return True if neighbours in a line are closer than points half a line apart."""
    sampled = lines[:: max(1, len(lines) // _MAX_LINES)]
    length = sampled.shape[1]
    places = np.arange(0, length, max(1, length // _MAX_PLACES))

    def median_angle(step: int) -> float:
        """Return the median of 1 - cos of the angle between points `step` places apart."""
        start, end = (sampled[:, (places + offset) % length].astype(np.float64) for offset in (0, step))
        measured = is_measured(start) & is_measured(end)
        start, end = start[measured], end[measured]
        if len(start) < _MIN_PAIRS:
            return np.nan
        lengths = np.linalg.norm(start, axis=1) * np.linalg.norm(end, axis=1)
        return max(0.0, float(np.median(1 - (start * end).sum(axis=1) / lengths)))

    return not median_angle(1) >= 0.5 * median_angle(length // 2)  # False for NaN
