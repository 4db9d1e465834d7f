# SPDX-License-Identifier: Apache-2.0
"""Ghost points: squares of pixels that float before or behind the surface, as stereo and structured light mismatch."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.types import DepthImage

_CLEARANCE = (
    0.07  # least distance from the surface, relative to its depth; nearer ones are noise of the surface
)


class Ghosts(FrozenModel):
    """Squares at random positions, each at a depth of its own, that together cover this share of all pixels."""

    share: float = Field(ge=0, lt=1)
    side_px: int = Field(ge=1)
    towards: Literal["front", "behind", "both"] = "both"
    min_depth_m: float = Field(default=0.4, gt=0)
    max_depth_m: float = Field(default=5.0, gt=0)


def add_ghosts(depth_m: DepthImage, ghosts: Ghosts, rng: np.random.Generator) -> DepthImage:
    """Return the image with ghosts; a lost pixel (NaN) stays lost, and a ray that hits nothing (inf) as well.

    Depths are uniform between the surface and a limit of the camera. Where there is no room on a side, there are no
    ghosts.
    """
    height, width = depth_m.shape
    side = ghosts.side_px
    count = round(ghosts.share * height * width / side**2)
    rows, columns = (rng.integers(0, max(1, size - side + 1), count) for size in (height, width))
    behind = rng.random(count) < {"front": 0.0, "behind": 1.0, "both": 0.5}[ghosts.towards]
    places = rng.random(count)
    # (count, side, side) pixels of each square; of overlapping squares, the last is seen.
    steps = np.arange(side)
    pixels = tuple(
        np.minimum(first, size - 1)
        for first, size in zip(
            np.broadcast_arrays(rows[:, None, None] + steps[:, None], columns[:, None, None] + steps),
            depth_m.shape,
            strict=True,
        )
    )
    surface = depth_m[pixels].astype(np.float64)
    finite = np.isfinite(surface)
    farthest = np.where(finite, surface, -np.inf).max(axis=(1, 2))
    nearest = np.where(finite, surface, np.inf).min(axis=(1, 2))
    low = np.where(behind, farthest * (1 + _CLEARANCE), ghosts.min_depth_m)
    high = np.where(behind, ghosts.max_depth_m, nearest * (1 - _CLEARANCE))
    with np.errstate(invalid="ignore"):
        ghost_m = low + places * (high - low)
    changes = finite & (low < high)[:, None, None]
    changed = depth_m.copy()
    row, column = (pixel[changes] for pixel in pixels)
    changed[row, column] = np.broadcast_to(ghost_m[:, None, None], changes.shape)[changes]
    return changed
