# SPDX-License-Identifier: Apache-2.0
"""Shaded pictures of rendered scenes: part colours under a lamp beside the camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from doorstate.io.camera import Intrinsics
from doorstate.io.depth import depth_to_points
from doorstate.simulation.render import Render
from doorstate.types import Part

COLORS = {
    Part.WALL: (226, 221, 208),
    Part.FRAME: (120, 92, 66),
    Part.LEAF: (178, 126, 74),
    Part.FLOOR: (150, 152, 158),
    Part.CEILING: (240, 240, 240),
    Part.OTHER: (96, 130, 158),
    Part.NONE: (28, 32, 40),
}
_PALETTE = np.zeros((256, 3), dtype=np.float32)
for _part, _color in COLORS.items():
    _PALETTE[_part] = _color
_TOWARDS_LAMP = np.array([-0.75, 0.45, 0.48])  # in the sensor frame
_LAMP = (_TOWARDS_LAMP / np.linalg.norm(_TOWARDS_LAMP)).astype(np.float32)


def shade(rendered: Render, intrinsics: Intrinsics) -> NDArray[np.uint8]:
    """Shade a rendering whose range is not cut.

    Returns:
        (H, W, 3) uint8 RGB.
    """
    points = depth_to_points(
        np.where(np.isinf(rendered.depth_m), np.float32(1e3), rendered.depth_m), intrinsics
    )
    # One coordinate at a time takes a quarter of the time of gradients and cross products of (H, W, 3).
    (dx, rx), (dy, ry), (dz, rz) = (np.gradient(axis) for axis in np.moveaxis(points, -1, 0).copy())
    normal = (ry * dz - rz * dy, rz * dx - rx * dz, rx * dy - ry * dx)
    length = np.sqrt(sum(component * component for component in normal))
    across = sum(component * lamp for component, lamp in zip(normal, _LAMP, strict=True))
    # The absolute value, because the sign of a normal from depth gradients is arbitrary.
    light = 0.45 + 0.55 * np.abs(across) / np.maximum(length, 1e-12)
    light[rendered.part == Part.NONE] = 1.0
    shaded: NDArray[np.uint8] = np.clip(_PALETTE[rendered.part] * light[..., None], 0, 255).astype(np.uint8)
    return shaded
