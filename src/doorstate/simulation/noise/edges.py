# SPDX-License-Identifier: Apache-2.0
"""Depth edges: pixels that see two surfaces are lost, or report a depth between the two."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.types import DepthImage


class Edges(FrozenModel):
    """Shares of pixels beside a depth jump (docs/sensors.md)."""

    jump: float = Field(default=0.05, gt=0)  # relative to the nearer depth, to one of the four neighbours
    lost: float = Field(default=0.5, ge=0, le=1)
    flying: float = Field(default=0.1, ge=0, le=1)  # share of the pixels not lost


def blur_edges(
    depth_m: DepthImage, surface_m: DepthImage, edges: Edges, rng: np.random.Generator
) -> DepthImage:
    """Set pixels beside a jump to NaN, or to a depth between both surfaces.

    A lost pixel (NaN) makes no jump, and no pixel gets a depth towards infinity (inf).

    Args:
        depth_m: (H, W) metres, as measured.
        surface_m: (H, W) metres, before noise, because noise alone makes jumps far away.
        edges: size of a jump, and shares.
        rng: random numbers of this stage.
    """
    across = _across(depth_m, surface_m, edges.jump).ravel()
    beside = np.flatnonzero(~np.isnan(across))
    lost, flies, share = rng.random((3, len(beside)), dtype=np.float32)
    mixed = depth_m.copy()
    flat = mixed.ravel()
    own, far = flat[beside], across[beside]
    flying = (flies < np.float32(edges.flying)) & np.isfinite(own) & np.isfinite(far)
    own[flying] += share[flying] * (far[flying] - own[flying])
    own[(lost < np.float32(edges.lost)) & np.isfinite(own)] = np.nan
    flat[beside] = own
    return mixed


def _across(depth_m: DepthImage, surface_m: DepthImage, jump: float) -> NDArray[np.float32]:
    """Return the depth measured on the other side of a jump, NaN where there is no jump."""
    across = np.full(depth_m.shape, np.nan, np.float32)
    for first, second in (
        (np.s_[:, :-1], np.s_[:, 1:]),
        (np.s_[:-1, :], np.s_[1:, :]),
    ):
        apart = np.minimum(surface_m[first], surface_m[second])
        apart *= np.float32(1 + jump)
        jumps = np.maximum(surface_m[first], surface_m[second]) > apart
        np.copyto(across[first], depth_m[second], where=jumps)
        np.copyto(across[second], depth_m[first], where=jumps)
    return across
