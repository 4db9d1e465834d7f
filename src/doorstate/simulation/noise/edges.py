# SPDX-License-Identifier: Apache-2.0
"""Depth edges: pixels that see two surfaces at once give nothing, or a depth between the two."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.types import DepthImage


class Edges(FrozenModel):
    """Shares of SIMULATION section 3.2."""

    jump: float = Field(default=0.05, gt=0)  # of the nearer depth, to one of the four pixels around
    lost: float = Field(default=0.5, ge=0, le=1)
    flying: float = Field(default=0.1, ge=0, le=1)  # of those not lost


def blur_edges(
    depth_m: DepthImage, surface_m: DepthImage, edges: Edges, rng: np.random.Generator
) -> DepthImage:
    """NaN, or anywhere between both depths, in pixels beside a jump.

    A pixel that was lost is no other surface, and one that sees nothing (inf) is no depth to fly to.

    Args:
        depth_m: (H, W) metres, as measured.
        surface_m: (H, W) metres, before noise: far away, noise alone makes jumps that are no edges.
        edges: what a jump is, and what it does.
        rng: of this stage.
    """
    other = _across(depth_m, surface_m, edges.jump).ravel()
    beside = np.flatnonzero(~np.isnan(other))
    lost, flies, share = rng.random((3, len(beside)), dtype=np.float32)
    mixed = depth_m.copy()
    flat = mixed.ravel()
    own, far = flat[beside], other[beside]
    flying = (flies < np.float32(edges.flying)) & np.isfinite(own) & np.isfinite(far)
    own[flying] += share[flying] * (far[flying] - own[flying])
    own[(lost < np.float32(edges.lost)) & np.isfinite(own)] = np.nan
    flat[beside] = own
    return mixed


def _across(depth_m: DepthImage, surface_m: DepthImage, jump: float) -> NDArray[np.float32]:
    """Depth measured on the other side of a jump, NaN where there is none."""
    other = np.full(depth_m.shape, np.nan, np.float32)
    for one, two in (
        (np.s_[:, :-1], np.s_[:, 1:]),
        (np.s_[:-1, :], np.s_[1:, :]),
    ):
        apart = np.minimum(surface_m[one], surface_m[two])
        apart *= np.float32(1 + jump)
        jumps = np.maximum(surface_m[one], surface_m[two]) > apart
        np.copyto(other[one], depth_m[two], where=jumps)
        np.copyto(other[two], depth_m[one], where=jumps)
    return other
