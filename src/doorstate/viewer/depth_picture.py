# SPDX-License-Identifier: Apache-2.0
"""Pictures of organized clouds, and colour images beside them."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from doorstate._input import open_input
from doorstate.io.size_limits import MAX_FILE_BYTES, check_point_count
from doorstate.types import Points

_QUANTILES = (0.02, 0.98)  # ends of the colour scale, so that outliers do not take all colours
_UNMEASURED_RGB = (70, 70, 70)
_STEPS = 320  # of the relief across the image
_LEAST_M, _NOISE_QUANTILE, _NOISE_FACTOR = 0.005, 0.7, 2.0  # of jumps that are drawn
_DARKEST_M, _DARKNESS = 0.06, 0.65
# Viridis, near is bright.
_STOPS = ("#fde725", "#aadc32", "#5ec962", "#27ad81", "#21918c", "#2c728e", "#3b528b", "#472d7b", "#440154")


def depth_picture(cloud: Points) -> NDArray[np.uint8]:
    """Return (H, W, 3) colours of the distance forward of an organized cloud: near is bright, unmeasured is grey."""
    depth_m = cloud[..., 0].astype(np.float64)
    measured = np.isfinite(depth_m) & (depth_m != 0)
    picture = np.full((*depth_m.shape, 3), _UNMEASURED_RGB, dtype=np.uint8)
    if measured.any():
        near_m, far_m = np.quantile(depth_m[measured], _QUANTILES)
        share = np.clip((depth_m[measured] - near_m) / max(1e-6, far_m - near_m), 0, 1)
        stops = np.array([[int(stop[k : k + 2], 16) for k in (1, 3, 5)] for stop in _STOPS])
        places = np.linspace(0, 1, len(stops))
        colors = [np.interp(share, places, stops[:, channel]) for channel in range(3)]
        picture[measured] = np.stack(colors, axis=1).round().astype(np.uint8)
    return picture


def relief_picture(cloud: Points) -> NDArray[np.uint8]:
    """Return the depth picture with edges of surfaces darkened, so that a shut leaf can be told from its wall.

    The inverse of the depth is linear in the image on every plane, so that its second differences show edges alone.
    """
    picture = depth_picture(cloud)
    step = max(1, cloud.shape[1] // _STEPS)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth_m = np.where(cloud[..., 0] > 0, cloud[..., 0], np.nan).astype(np.float64)
        inverse = 1 / depth_m
        smooth = _running_mean(_running_mean(inverse, step, 0), step, 1)
        jump_m = np.zeros_like(inverse)
        for axis in (0, 1):
            bend = np.roll(smooth, 2 * step, axis) + np.roll(smooth, -2 * step, axis) - 2 * smooth
            rim = [slice(None)] * 2
            for rim[axis] in (slice(None, 3 * step), slice(-3 * step, None)):
                bend[tuple(rim)] = 0  # rolled over
            jump_m = np.fmax(jump_m, np.abs(bend) * depth_m**2)
        # Errors of stereo grow with the square of the distance, and differ from camera to camera.
        noise = np.nanquantile(jump_m / depth_m**2, _NOISE_QUANTILE) if np.isfinite(depth_m).any() else 0.0
        least_m = _LEAST_M + _NOISE_FACTOR * noise * depth_m**2
        shade = np.nan_to_num(np.clip((jump_m - least_m) / _DARKEST_M, 0, 1)) * _DARKNESS
    return (picture * (1 - shade[..., None])).astype(np.uint8)


def _running_mean(values: NDArray[np.float64], reach: int, axis: int) -> NDArray[np.float64]:
    shifted: NDArray[np.float64] = sum(
        (np.roll(values, shift, axis) for shift in range(-reach, reach + 1)), np.zeros_like(values)
    )
    return shifted / (2 * reach + 1)


def colour_picture(path: Path) -> NDArray[np.uint8] | None:
    """Return the (H, W, 3) pixels of an image file; None if it is missing or damaged."""
    # A page does not depend on the picture; on damaged bytes Pillow raises exceptions of any type.
    with suppress(Exception), open_input(path, MAX_FILE_BYTES) as stream, Image.open(stream) as image:
        check_point_count(image.width * image.height)
        return np.asarray(image.convert("RGB"))
    return None
