# SPDX-License-Identifier: Apache-2.0
"""Pixels hidden from the second view: a pattern projector's shadow, or a stereo pair's occlusion.

With the second view at a baseline b to the right, a pixel at column u and depth z lies at column u - f b / z there. A
surface is hidden if a nearer one lies at the same column: f b (1 / z_near - 1 / z_far) pixels are without depth.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.types import DepthImage


class SecondView(FrozenModel):
    """Position of the projector or second imager."""

    baseline_m: float = Field(gt=0)
    towards: Literal["right", "down"] = "right"  # from the camera, in the image
    # An imager has the camera's field of view, so a band at the border has no depth; a projector's field is wider.
    is_imager: bool = False
    # Assumed: smaller gaps are one surface. A plane farther away than three baselines never has such gaps.
    tolerance_px: float = Field(default=0.5, gt=0)


def hide_from_second_view(depth_m: DepthImage, view: SecondView, focal_px: float) -> DepthImage:
    """Set pixels to NaN where the second view cannot see the surface; (H, W) metres, inf where there is none."""
    if view.towards == "down":
        turned = hide_from_second_view(depth_m.T, view.model_copy(update={"towards": "right"}), focal_px)
        return np.ascontiguousarray(turned.T)
    surface_m = np.where(np.isnan(depth_m), np.float32(np.inf), depth_m)
    disparity: NDArray[np.float32] = np.divide(np.float32(focal_px * view.baseline_m), surface_m)
    column = np.arange(depth_m.shape[1], dtype=np.float32) - disparity
    hidden = _covered(disparity, np.floor(column).astype(np.int32), view.tolerance_px)
    if view.is_imager:
        hidden |= (column < -0.5) & (disparity > 0)
    return np.where(hidden, np.float32(np.nan), depth_m)


def _covered(
    disparity: NDArray[np.float32], column: NDArray[np.int32], tolerance_px: float
) -> NDArray[np.bool_]:
    """Return pixels whose two nearest columns in the second view's z-buffer both hold something nearer."""
    height, width = disparity.shape
    first = int(column.min(initial=0))
    stride = width - first + 1
    place = (np.arange(height)[:, None] * stride + (column - first)).ravel()
    nearest = np.zeros(height * stride + 1, np.float32)
    for shift in (0, 1):
        np.maximum.at(nearest, place + shift, disparity.ravel())
    both = np.minimum(nearest[place], nearest[place + 1]).reshape(disparity.shape)
    hidden: NDArray[np.bool_] = both > disparity + np.float32(tolerance_px)
    return hidden
