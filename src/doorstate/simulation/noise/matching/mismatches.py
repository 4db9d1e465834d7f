# SPDX-License-Identifier: Apache-2.0
"""Wrong planes: patches that a repeated or weak texture matches to a place far from the right one."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.simulation.noise.windows import Image


class Mismatches(FrozenModel):
    """Share of the area that is matched wrongly where the contrast is just enough; falls with its square."""

    share: float = Field(ge=0, lt=1)
    radius_px: int = Field(default=6, ge=2)  # assumed: mean radius of a patch


def mismatch(
    disparity_px: Image, contrast: Image, farthest_px: float, mismatches: Mismatches, rng: np.random.Generator
) -> None:
    """Shift the disparity of round patches, in place; a patch keeps the slope of its surface.

    Args:
        disparity_px: (H, W) as measured.
        contrast: (H, W), 1 where it is just enough for a match.
        farthest_px: largest disparity that the matcher tries.
        mismatches: share and size.
        rng: random numbers of this stage.
    """
    height, width = disparity_px.shape
    radius = mismatches.radius_px
    count = int(mismatches.share * height * width / (3 * radius**2))
    rows, columns = rng.integers(0, height, count).tolist(), rng.integers(0, width, count).tolist()
    radii = rng.integers(radius // 2, 2 * radius - radius // 2 + 1, count).tolist()
    flattening, place, chance = rng.random((3, count), dtype=np.float32)
    steps = np.arange(-2 * radius, 2 * radius + 1, dtype=np.float32)
    for number, (row, column, size) in enumerate(zip(rows, columns, radii, strict=True)):
        here = contrast[row, column]
        if chance[number] * here * here > 1:
            continue
        top, left = max(row - size, 0), max(column - size, 0)
        patch = disparity_px[top : row + size + 1, left : column + size + 1]
        down = steps[2 * radius + top - row :][: patch.shape[0], None]
        right = steps[2 * radius + left - column :][: patch.shape[1]]
        shift = place[number] * np.float32(farthest_px) - disparity_px[row, column]
        tall = np.float32(1) + np.float32(2) * flattening[number]
        inside = down * down * tall + right * right <= np.float32(size * size)
        patch[inside] += shift
