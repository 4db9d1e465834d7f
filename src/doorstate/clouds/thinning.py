# SPDX-License-Identifier: Apache-2.0
"""Thinning of organized clouds before farthest-point sampling."""

from __future__ import annotations

import numpy as np

from doorstate.types import Indices

_PIXELS_PER_POINT = 16  # left to sample from


def thinned_pixels(shape: tuple[int, ...], num_points: int) -> Indices:
    """Return the rows of a flattened cloud that thinning keeps: those of every k-th row and column of an image.

    Args:
        shape: (H, W, 3), or (N, 3), which is not thinned.
        num_points: points to be sampled; at least 16 times as many pixels remain, if there are that many.
    """
    if len(shape) != 3:
        return np.arange(int(np.prod(shape[:-1])))
    height, width, _ = shape
    step = max(1, int(np.sqrt(height * width / (_PIXELS_PER_POINT * num_points))))
    return (np.arange(0, height, step)[:, None] * width + np.arange(0, width, step)).ravel()
