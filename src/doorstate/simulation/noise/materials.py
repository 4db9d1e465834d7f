# SPDX-License-Identifier: Apache-2.0
"""Surfaces that return too little light, or send it elsewhere: glass, gloss and dark."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.io.camera import Intrinsics
from doorstate.simulation.scene import Box
from doorstate.simulation.sensor import CameraPose, Render, is_made_of, render
from doorstate.types import DepthImage


class Materials(FrozenModel):
    """Shares of pixels lost, of SIMULATION section 3.2 but for what is marked as chosen."""

    glass_lost: float = Field(default=0.7, ge=0, le=1)  # the others see what is behind the pane
    dark_lost: float = Field(default=0.3, ge=0, le=1)
    gloss_mirror_deg: float = Field(default=5.0, ge=0)  # chosen: nearer to the normal than this, all is lost
    patch_px: int = Field(default=8, ge=1)  # chosen: pixels are lost by squares of this side


def loss_shares(
    materials: Materials,
    seen: Render,
    incidence_rad: NDArray[np.float32],
    boxes: Sequence[Box],
    pose: CameraPose,
    intrinsics: Intrinsics,
) -> NDArray[np.float32] | None:
    """How probable it is that a pixel is lost to its material.

    Args:
        materials: the shares.
        seen: what `render_behind_glass` saw.
        incidence_rad: (H, W), of what it saw.
        boxes: all, with the glass.
        pose: of the camera.
        intrinsics: of the camera.

    Returns:
        (H, W), None where every box is matte.
    """
    kinds = {box.material for box in boxes}
    if kinds <= {"matte"}:
        return None
    shares = np.zeros(seen.box.shape, np.float32)
    if "dark" in kinds:
        shares[is_made_of("dark", seen, boxes)] = materials.dark_lost
    if "gloss" in kinds:
        mirrors = incidence_rad < np.radians(materials.gloss_mirror_deg)
        shares[is_made_of("gloss", seen, boxes) & mirrors] = 1.0
    if "glass" in kinds:
        pane = is_made_of("glass", render(boxes, pose, intrinsics), boxes)
        shares[pane] = 1 - (1 - materials.glass_lost) * (1 - shares[pane])
    return shares


def lose_patches(
    depth_m: DepthImage, shares: NDArray[np.float32], patch_px: int, rng: np.random.Generator
) -> DepthImage:
    """NaN with each pixel's own probability (H, W), and alike within squares of `patch_px`."""
    height, width = depth_m.shape
    drawn = rng.random((-(-height // patch_px), -(-width // patch_px)), dtype=np.float32)
    spread = drawn.repeat(patch_px, axis=0).repeat(patch_px, axis=1)[:height, :width]
    return np.where(spread < shares, np.float32(np.nan), depth_m)
