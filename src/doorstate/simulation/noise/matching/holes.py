# SPDX-License-Identifier: Apache-2.0
"""Holes: windows with too little pattern or texture, and windows across an edge, have no sure match."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.simulation.noise.windows import Image, blobs


class Holes(FrozenModel):
    """Holes where contrast is too weak to match; 1 is the contrast that a window needs on average."""

    spread: float = Field(default=0.5, ge=0)  # assumed: standard deviation of the contrast that is needed
    edge_lost: float = Field(
        default=0.25, ge=0, le=1
    )  # assumed: share of windows across an edge without match
    edge_px: int = Field(default=3, ge=1)  # assumed: side of the squares lost there


def lose_weak(contrast: Image, holes: Holes, window_px: int, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return the pixels (H, W) whose contrast is below what their window needs; holes have the size of windows."""
    needed = blobs(contrast.shape, window_px, rng)
    needed *= np.float32(holes.spread)
    needed += np.float32(1)
    lost: NDArray[np.bool_] = contrast < needed
    return lost


def lose_at_edges(edges: NDArray[np.bool_], holes: Holes, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return the pixels (H, W) at an edge without match, in small squares."""
    height, width = edges.shape
    side = holes.edge_px
    drawn = rng.random((height // side + 1, width // side + 1), dtype=np.float32) < np.float32(
        holes.edge_lost
    )
    rows, columns = np.nonzero(edges)
    lost = np.zeros(edges.shape, np.bool_)
    lost[rows, columns] = drawn[rows // side, columns // side]
    return lost
