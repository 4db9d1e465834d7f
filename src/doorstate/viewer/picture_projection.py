# SPDX-License-Identifier: Apache-2.0
"""Projection of an organized cloud into its own image, told from the points themselves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.measured import is_measured
from doorstate.types import Points

_SAMPLES = 3000
_FEWEST = 50
_MAX_ERROR = 0.01  # median, in widths of the image; a distorted image is off by as much at its corners


def fit_projection(image: Points) -> NDArray[np.float64] | None:
    """Return the (3, 3) matrix from points of the camera, in any direction of its axes, to pixels (u, v, 1) w.

    A pinhole maps rays to pixels by a homography, which holds for tilted and turned cameras too (Hartley & Zisserman
    2004, 6.1). It is fitted by the direct linear transform. `w` is positive in front of the camera.

    Args:
        image: (H, W, 3) points, camera at the origin.

    Returns:
        The matrix; None for too few points, or an image that no pinhole at the origin took.
    """
    height, width = image.shape[:2]
    rows, columns = np.nonzero(is_measured(image))
    if len(rows) < _FEWEST:
        return None
    chosen = np.linspace(0, len(rows) - 1, min(_SAMPLES, len(rows))).astype(np.int64)
    rows, columns = rows[chosen], columns[chosen]
    points = image[rows, columns].astype(np.float64)
    rays = points / np.linalg.norm(points, axis=1, keepdims=True)
    u, v = 2 * columns / width - 1, 2 * rows / height - 1
    zeros = np.zeros_like(rays)
    equations = np.concatenate(
        [np.hstack([rays, zeros, -u[:, None] * rays]), np.hstack([zeros, rays, -v[:, None] * rays])]
    )
    matrix = np.linalg.svd(equations, full_matrices=False)[2][-1].reshape(3, 3)
    w = rays @ matrix[2]
    if np.median(w) < 0:
        matrix, w = -matrix, -w
    if (w <= 0).mean() > 0.01:
        return None
    to_pixels = np.array([[width / 2, 0, width / 2], [0, height / 2, height / 2], [0, 0, 1]])
    projected = rays @ (to_pixels @ matrix).T
    pixels = projected[:, :2] / projected[:, 2:]
    errors = np.hypot(pixels[:, 0] - columns, pixels[:, 1] - rows)
    if np.median(errors) > _MAX_ERROR * width:
        return None
    fitted: NDArray[np.float64] = to_pixels @ matrix
    return fitted / np.linalg.norm(fitted[2])
