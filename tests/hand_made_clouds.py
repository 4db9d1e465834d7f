# SPDX-License-Identifier: Apache-2.0
"""A cloud for tests in which its content does not matter."""

from __future__ import annotations

import numpy as np


def image_of_a_rough_wall(height: int, width: int) -> np.ndarray:
    """Return (height, width, 3) metres, x forward, y left, z up: 2 m away, 2 m wide and high, half a metre rough."""
    across, up = np.meshgrid(np.linspace(1, -1, width), np.linspace(1, -1, height))
    depth_m = 2 + np.random.default_rng(0).uniform(-0.25, 0.25, (height, width))
    return (depth_m[..., None] * np.stack((np.ones_like(up), across / 2, up / 2), axis=-1)).astype(np.float32)
