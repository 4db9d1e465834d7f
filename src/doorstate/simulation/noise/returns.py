# SPDX-License-Identifier: Apache-2.0
"""Returns of glass and gloss: nothing, the surface itself, or something behind it."""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.simulation.noise.optical import Image, View
from doorstate.simulation.noise.windows import blobs
from doorstate.simulation.render import Render, is_made_of, render

_BLOB_PX = 10  # assumed: half the width of a patch that returns alike


class Returns(FrozenModel):
    """Shares of the area of panes and glossy surfaces (docs/sensors.md); the rest is measured as the pane or surface.

    Behind a pane is what stands there; behind a glossy surface is the mirror image of the room.
    """

    glass_lost: float = Field(default=0.5, ge=0, le=1)
    glass_behind: float = Field(default=0.35, ge=0, le=1)
    gloss_lost: float = Field(default=0.1, ge=0, le=1)
    gloss_behind: float = Field(default=0.05, ge=0, le=1)
    mirror_deg: float = Field(default=5.0, ge=0)  # nearer to the normal, gloss blinds the sensor
    farthest_image: float = Field(default=1.5, ge=0)  # mirror images, relative to the distance of the mirror


def reflect(returns: Returns, view: View, cosine: Image) -> Render:
    """Return the rendering as light returns from it: NaN where a pane or glossy surface returns nothing.

    Args:
        returns: shares.
        view: result of `render_behind_glass`.
        cosine: (H, W) of the angle of incidence.
    """
    rendered = view.rendered
    if any(box.material == "gloss" for box in view.boxes):
        depth_m = _mirrored(returns, view, cosine, is_made_of("gloss", rendered, view.boxes))
        rendered = rendered._replace(depth_m=depth_m)
    pane = rendered.pane
    if pane is None or not pane.any():
        return rendered
    front = render(view.boxes, view.pose, view.intrinsics)
    field = blobs(pane.shape, _BLOB_PX, view.rng("glass"))
    lost, behind = _levels(returns.glass_lost, returns.glass_behind)
    own = pane & (field >= behind)
    depth_m = np.where(own, front.depth_m, rendered.depth_m)
    depth_m[pane & (field < lost)] = np.nan
    part, box = np.where(own, front.part, rendered.part), np.where(own, front.box, rendered.box)
    return rendered._replace(depth_m=depth_m, part=part, box=box)


def _mirrored(returns: Returns, view: View, cosine: Image, gloss: NDArray[np.bool_]) -> Image:
    """Lose glossy pixels that blind the sensor, and push patches behind the surface."""
    depth_m = view.rendered.depth_m.copy()
    if gloss.any():
        rng = view.rng("gloss")
        field, image = (blobs(gloss.shape, _BLOB_PX, rng) for _ in range(2))
        lost, behind = _levels(returns.gloss_lost, returns.gloss_behind)
        blinds = cosine > np.float32(math.cos(math.radians(returns.mirror_deg)))
        seen = gloss & (field >= lost) & (field < behind)
        # An image lies behind the mirror as far as the room lies before it.
        away = np.minimum(np.abs(image[seen]), np.float32(1)) * np.float32(returns.farthest_image)
        depth_m[seen] *= np.float32(1) + away
        depth_m[gloss & (blinds | (field < lost))] = np.nan
    return depth_m


def _levels(lost: float, behind: float) -> tuple[np.float32, np.float32]:
    """Return the levels of normal noise below which these shares lie, one after the other."""
    first, second = (NormalDist().inv_cdf(min(max(share, 1e-9), 1 - 1e-9)) for share in (lost, lost + behind))
    return np.float32(first), np.float32(second)
