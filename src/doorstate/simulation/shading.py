# SPDX-License-Identifier: Apache-2.0
"""A colour-like picture of a rendered scene, for the eye: part colours under a lamp beside the camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.camera import Intrinsics
from doorstate.clouds.depth import depth_to_points
from doorstate.simulation.sensor import Render
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
_LAMP = np.array([-0.75, 0.45, 0.48])  # towards the light, in the sensor frame


def shade(rendered: Render, intrinsics: Intrinsics) -> NDArray[np.uint8]:
    """Draw an uncut rendering.

    Returns:
        (H, W, 3) uint8 RGB.
    """
    points = depth_to_points(np.where(np.isinf(rendered.depth_m), 1e3, rendered.depth_m), intrinsics)
    down, right = np.gradient(points.astype(np.float64), axis=(0, 1))
    normal = np.cross(right, down)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    # Faces are lit from both sides: the sign of a depth gradient's normal says nothing here.
    light = 0.45 + 0.55 * np.abs(normal @ _LAMP) / np.linalg.norm(_LAMP)
    nothing = rendered.part == Part.NONE
    light[nothing] = 1.0
    shaded: NDArray[np.uint8] = np.clip(_PALETTE[rendered.part] * light[..., None], 0, 255).astype(np.uint8)
    return shaded
