# SPDX-License-Identifier: Apache-2.0
"""Pixels that give nothing: at a grazing angle, and here and there."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.types import DepthImage


class Grazing(FrozenModel):
    """The share lost grows from 0 to 1 between two angles of incidence (SIMULATION section 3.2)."""

    from_deg: float = 70.0
    to_deg: float = 90.0


class Speckle(FrozenModel):
    """Squares that are lost at random, so that this share of all pixels is."""

    share: float = Field(ge=0, lt=1)
    side_px: int = Field(ge=1)


def lose_grazing(
    depth_m: DepthImage, incidence_rad: NDArray[np.float32], grazing: Grazing, rng: np.random.Generator
) -> DepthImage:
    """NaN with the probability of each pixel's incidence (H, W)."""
    low, high = math.radians(grazing.from_deg), math.radians(grazing.to_deg)
    steep = np.flatnonzero(incidence_rad > np.float32(low))
    share = (incidence_rad.ravel()[steep] - np.float32(low)) / np.float32(high - low)
    kept = depth_m.copy()
    kept.ravel()[steep[rng.random(len(steep), dtype=np.float32) < share]] = np.nan
    return kept


def lose_speckle(depth_m: DepthImage, speckle: Speckle, rng: np.random.Generator) -> DepthImage:
    """NaN in squares whose places are independent; they may overlap and stand over the border."""
    side = speckle.side_px
    height, width = depth_m.shape
    # A pixel survives if none of the side^2 squares that would cover it is there.
    chance = -math.expm1(math.log1p(-speckle.share) / side**2)
    corners = rng.random((height + side - 1, width + side - 1), dtype=np.float32) < np.float32(chance)
    rows, columns = np.nonzero(corners)
    kept = depth_m.copy()
    for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
        kept[max(row - side + 1, 0) : row + 1, max(column - side + 1, 0) : column + 1] = np.nan
    return kept
