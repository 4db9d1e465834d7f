# SPDX-License-Identifier: Apache-2.0
"""Lost pixels: at grazing angles, and in random speckles."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.types import DepthImage


class Grazing(FrozenModel):
    """Loss probability that grows from 0 to 1 between two angles of incidence (docs/sensors.md)."""

    from_deg: float = 70.0
    to_deg: float = 90.0


class Speckle(FrozenModel):
    """Random lost squares that together cover this share of all pixels."""

    share: float = Field(ge=0, lt=1)
    side_px: int = Field(ge=1)


def lose_grazing(
    depth_m: DepthImage, incidence_rad: NDArray[np.float32], grazing: Grazing, rng: np.random.Generator
) -> DepthImage:
    """Set pixels to NaN with the probability that belongs to their incidence (H, W)."""
    low, high = math.radians(grazing.from_deg), math.radians(grazing.to_deg)
    steep = np.flatnonzero(incidence_rad > np.float32(low))
    share = (incidence_rad.ravel()[steep] - np.float32(low)) / np.float32(high - low)
    kept = depth_m.copy()
    kept.ravel()[steep[rng.random(len(steep), dtype=np.float32) < share]] = np.nan
    return kept


def lose_speckle(depth_m: DepthImage, speckle: Speckle, rng: np.random.Generator) -> DepthImage:
    """Set squares at independent positions to NaN; they may overlap each other and the border."""
    side = speckle.side_px
    height, width = depth_m.shape
    # A pixel survives if none of the side^2 squares that could cover it is drawn.
    chance = -math.expm1(math.log1p(-speckle.share) / side**2)
    corners = rng.random((height + side - 1, width + side - 1), dtype=np.float32) < np.float32(chance)
    # Searching a plane takes ten times as long.
    rows, columns = np.divmod(np.flatnonzero(corners), corners.shape[1])
    kept = depth_m.copy()
    for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
        kept[max(row - side + 1, 0) : row + 1, max(column - side + 1, 0) : column + 1] = np.nan
    return kept
