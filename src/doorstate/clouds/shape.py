# SPDX-License-Identifier: Apache-2.0
"""Shapes of clouds: (N, 3), organized (H, W, 3), and batches (B, N, 3) that look like an organized cloud."""

from __future__ import annotations

import numpy as np

from doorstate._organized import is_image
from doorstate.clouds.measured import quiet_nans
from doorstate.errors import CloudContentError
from doorstate.types import Points


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
    if cloud.dtype == np.float16:  # limits of coordinates, and squares of coordinates, exceed its range
        with np.errstate(invalid="ignore"):
            cloud = cloud.astype(np.float32)
    return quiet_nans(cloud)


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
