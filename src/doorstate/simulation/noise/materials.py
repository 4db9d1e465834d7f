# SPDX-License-Identifier: Apache-2.0
"""Pixels lost on surfaces that return too little light: glass, gloss and dark."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.simulation.render import Render, is_made_of
from doorstate.simulation.scene.box import Box
from doorstate.types import DepthImage


class Materials(FrozenModel):
    """Shares of lost pixels (docs/sensors.md)."""

    glass_lost: float = Field(default=0.7, ge=0, le=1)  # the other pixels see through the pane
    dark_lost: float = Field(default=0.3, ge=0, le=1)
    gloss_mirror_deg: float = Field(default=5.0, ge=0)  # assumed: all pixels nearer to the normal are lost
    patch_px: int = Field(default=8, ge=1)  # assumed: pixels are lost in squares of this side


def loss_shares(
    materials: Materials,
    rendered: Render,
    incidence_rad: NDArray[np.float32],
    boxes: Sequence[Box],
) -> NDArray[np.float32] | None:
    """Return the probability of each pixel to be lost on its material.

    Args:
        materials: shares of lost pixels.
        rendered: result of `render_behind_glass`.
        incidence_rad: (H, W), `render.incidence` of the same rendering.
        boxes: scene in the door frame, with the glass.

    Returns:
        (H, W), or None if every box is matte.
    """
    kinds = {box.material for box in boxes}
    if kinds <= {"matte"}:
        return None
    shares = np.zeros(rendered.box.shape, np.float32)
    if "dark" in kinds:
        shares[is_made_of("dark", rendered, boxes)] = materials.dark_lost
    if "gloss" in kinds:
        mirrors = incidence_rad < np.radians(materials.gloss_mirror_deg)
        shares[is_made_of("gloss", rendered, boxes) & mirrors] = 1.0
    if rendered.pane is not None:
        shares[rendered.pane] = 1 - (1 - materials.glass_lost) * (1 - shares[rendered.pane])
    return shares


def lose_patches(
    depth_m: DepthImage, shares: NDArray[np.float32], patch_px: int, rng: np.random.Generator
) -> DepthImage:
    """Set pixels to NaN with their own probability (H, W), with one random number for each square of `patch_px`."""
    height, width = depth_m.shape
    drawn = rng.random((-(-height // patch_px), -(-width // patch_px)), dtype=np.float32)
    spread = drawn.repeat(patch_px, axis=0).repeat(patch_px, axis=1)[:height, :width]
    return np.where(spread < shares, np.float32(np.nan), depth_m)
