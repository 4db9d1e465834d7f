# SPDX-License-Identifier: Apache-2.0
"""Fattened edges: windows that see two surfaces measure the nearer one, up to half a window beyond its edge."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from doorstate.simulation.noise.lateral import Moves
from doorstate.simulation.noise.windows import Image, widen, window_mean

_RAGGED_PX = 2  # assumed: the edge's course changes over this many pixels
_DIRECTIONS = ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1))


def find_edges(disparity_px: Image, window_px: int, jump_px: float) -> NDArray[np.bool_]:
    """Return the pixels (H, W) whose window holds a jump between neighbouring pixels."""
    jumps = np.zeros(disparity_px.shape, np.bool_)
    least = np.float32(jump_px)
    jumps[:, 1:] = np.abs(disparity_px[:, 1:] - disparity_px[:, :-1]) > least
    jumps[1:] |= np.abs(disparity_px[1:] - disparity_px[:-1]) > least
    return widen(jumps, window_px)


def average(disparity_px: Image, edges: NDArray[np.bool_], window_px: int) -> Image:
    """Return the mean disparity of each window without a jump: relief smaller than a jump is smoothed."""
    smooth = window_mean(disparity_px, window_px)
    np.copyto(smooth, disparity_px, where=edges)
    return smooth


def fatten(
    disparity_px: Image, edges: NDArray[np.bool_], reach_px: int, jump_px: float, rng: np.random.Generator
) -> Moves:
    """Draw the pixels beside an edge that take the measurement of the nearer surface.

    Args:
        disparity_px: (H, W), 0 where there is none.
        edges: (H, W) pixels whose window holds a jump.
        reach_px: half a window.
        jump_px: least difference between both surfaces.
        rng: random numbers of this stage.
    """
    height, width = disparity_px.shape
    drawn = rng.integers(0, reach_px + 1, (height // _RAGGED_PX + 1, width // _RAGGED_PX + 1), dtype=np.int8)
    rows, columns = np.nonzero(edges)
    reach = drawn[rows // _RAGGED_PX, columns // _RAGGED_PX]
    flat = disparity_px.ravel()
    targets = rows * width + columns
    nearest = flat[targets] + np.float32(jump_px)
    sources = targets.copy()
    for distance in range(1, reach_px + 1):
        reached = np.flatnonzero(reach >= distance)
        for down, right in _DIRECTIONS:
            row = np.clip(rows[reached] + down * distance, 0, height - 1)
            column = np.clip(columns[reached] + right * distance, 0, width - 1)
            place = row * width + column
            nearer = flat[place] > nearest[reached]
            changed = reached[nearer]
            nearest[changed] = flat[place[nearer]]
            sources[changed] = place[nearer]
    moved = sources != targets
    return Moves(targets[moved], sources[moved])
