# SPDX-License-Identifier: Apache-2.0
"""Ragged edges: near the edge of a surface a pixel takes the measurement of a pixel beside it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.simulation.render import Render


class Lateral(FrozenModel):
    """Standard deviation of Nguyen, Izadi and Lovell 2012: s = base + slope t / (pi / 2 - t) pixels at incidence t."""

    base_px: float = Field(default=0.8, ge=0)
    slope_px: float = Field(default=0.035, ge=0)
    reach_px: int = Field(default=3, ge=1)  # assumed: largest displacement

    def sigma_px(self, incidence_rad: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return (M,) standard deviations in pixels for (M,) angles of incidence."""
        steep = np.minimum(incidence_rad, np.float32(1.5))
        ratio: NDArray[np.float32] = np.divide(steep, np.float32(np.pi / 2) - steep)
        return ratio * np.float32(self.slope_px) + np.float32(self.base_px)


class Moves(NamedTuple):
    """Flat indices of pixels, and of the pixels whose measurement they take."""

    targets: NDArray[np.int64]
    sources: NDArray[np.int64]


def draw_moves(
    rendered: Render, incidence_rad: NDArray[np.float32], lateral: Lateral, rng: np.random.Generator
) -> Moves:
    """Draw the pixels that measure a neighbouring surface.

    Within a surface nothing moves: on a slope it would add noise along the ray, which the published axial noise already
    includes. Lost pixels stay lost.
    """
    height, width = rendered.box.shape
    near_edge = _widened(_edges(rendered.box), lateral.reach_px) & ~np.isnan(rendered.depth_m)
    targets = np.flatnonzero(near_edge)
    aside = rng.standard_normal((2, len(targets)), dtype=np.float32)
    aside *= lateral.sigma_px(incidence_rad.ravel()[targets])
    step = np.rint(np.clip(aside, -lateral.reach_px, lateral.reach_px)).astype(np.int64)
    row, column = np.divmod(targets, width)
    row, column = np.clip(row + step[0], 0, height - 1), np.clip(column + step[1], 0, width - 1)
    sources = row * width + column
    box = rendered.box.ravel()
    moved = box[sources] != box[targets]
    return Moves(targets[moved], sources[moved])


def _edges(box: NDArray[np.int16]) -> NDArray[np.bool_]:
    edges = np.zeros(box.shape, np.bool_)
    edges[:, 1:] |= box[:, 1:] != box[:, :-1]
    edges[1:] |= box[1:] != box[:-1]
    return edges


def _widened(mask: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    for axis in (0, 1):
        mask = np.moveaxis(mask, axis, 0)
        wide = mask.copy(order="K")
        for shift in range(1, reach + 1):
            wide[shift:] |= mask[:-shift]
            wide[:-shift] |= mask[shift:]
        mask = np.moveaxis(wide, 0, axis)
    return mask
