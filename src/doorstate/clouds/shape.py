# SPDX-License-Identifier: Apache-2.0
"""Shapes of clouds: (N, 3), organized (H, W, 3), and batches (B, N, 3) that look like an organized cloud."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate._organized import is_image
from doorstate.clouds.measured import quiet_nans
from doorstate.errors import CloudContentError
from doorstate.types import Points

_MOST_VALUES = 16  # of a point, such as colour and normal; a longer axis is one of an image


def check_shape(points: Points) -> Points:
    """Return points as an array, after checking its type and shape.

    Raises:
        CloudContentError: another shape than (N, 3) or (H, W, 3), or no numbers. A fourth value, such as an
            intensity, is refused: reshaping would mix the rows.
    """
    cloud = np.asarray(points)
    if cloud.dtype.kind not in "fiu" or cloud.ndim not in (2, 3) or cloud.shape[-1] != 3:
        raise CloudContentError(
            f"{cloud.dtype} of shape {cloud.shape} is not a cloud",
            expected="numbers of shape (N, 3) or (H, W, 3)",
            hint=_how_to_reshape(cloud),
        )
    if cloud.dtype == np.float16:  # limits of coordinates, and squares of coordinates, exceed its range
        with np.errstate(invalid="ignore"):
            cloud = cloud.astype(np.float32)
    return quiet_nans(cloud)


def _how_to_reshape(cloud: NDArray[Any]) -> str | None:
    """Return how to make a cloud of an array that seems to hold one."""
    if cloud.dtype.names is not None and {"x", "y", "z"} <= set(cloud.dtype.names):
        return "stack the fields x, y and z along a last axis"
    if cloud.dtype.kind not in "fiu" or cloud.ndim not in (2, 3):
        return None
    if cloud.shape[0] == 3 < cloud.shape[-1]:
        return "transpose it: x, y and z belong on the last axis"
    if 3 < cloud.shape[-1] <= _MOST_VALUES:
        return "keep x, y and z only"
    if cloud.ndim == 2 and min(cloud.shape) > _MOST_VALUES:
        return "a depth image is made a cloud with the intrinsics of its camera first"
    return None


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


def check_batch(clouds: Sequence[Points]) -> Sequence[Points]:
    """Return several clouds as they are, after checking that they are not one.

    Raises:
        CloudContentError: one cloud, (N, 3) or an image (H, W, 3).
    """
    whole = np.asarray(clouds) if hasattr(clouds, "ndim") else None
    if whole is not None and (whole.ndim == 2 or (whole.ndim == 3 and is_image(whole))):
        raise CloudContentError(f"this is one cloud, {whole.shape}: give several, or call the predictor")
    return clouds
