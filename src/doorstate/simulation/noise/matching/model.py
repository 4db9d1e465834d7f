# SPDX-License-Identifier: Apache-2.0
"""Sensor that measures depth by matching windows: structured light, active and passive stereo (docs/sensors.md)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.noise.axial import NguyenAxial, StereoAxial
from doorstate.simulation.noise.matching.fattening import average, fatten, find_edges
from doorstate.simulation.noise.matching.holes import Holes, lose_at_edges, lose_weak
from doorstate.simulation.noise.matching.mismatches import Mismatches, mismatch
from doorstate.simulation.noise.matching.overlap import lacks_overlap
from doorstate.simulation.noise.optical import (
    Emitter,
    Image,
    View,
    angles,
    cosines,
    draw_surfaces,
    ray_lengths,
    received,
)
from doorstate.simulation.noise.returns import Returns, reflect
from doorstate.simulation.noise.windows import correlated_noise
from doorstate.simulation.render import Render


class MatchingModel(FrozenModel):
    """A camera and how it matches.

    The second view is an imager for stereo. For structured light it is the projector, which sees no texture and has
    a wider field of view.
    """

    kind: Literal["matching"] = "matching"
    name: str
    camera: DepthCamera
    baseline_m: float = Field(gt=0)
    second_imager: bool = True
    window_px: int = Field(ge=3)  # odd
    step_px: float = Field(gt=0)  # of disparity
    axial: NguyenAxial | StereoAxial
    emitter: Emitter | None = None
    jump_px: float = Field(default=1.0, gt=0)  # assumed: smaller steps are one surface for a window
    holes: Holes = Holes()
    mismatches: Mismatches = Mismatches(share=0.01)
    returns: Returns = Returns()

    def distort(self, view: View) -> Render:
        """Return the measurement before the range is cut: inf where nothing is hit, NaN where nothing is matched."""
        scale = np.float32(view.intrinsics.fx * self.baseline_m)
        cosine, contrast = self._light(view)
        rendered = reflect(self.returns, view, cosine)
        exact = np.divide(scale, rendered.depth_m)
        lost = np.isnan(exact)
        np.copyto(exact, np.float32(0), where=lost)
        edges = find_edges(exact, self.window_px, self.jump_px)
        disparity = average(exact, edges, self.window_px)
        lost |= lacks_overlap(exact, self.second_imager)
        lost |= lose_weak(contrast, self.holes, self.window_px, view.rng("holes"))
        moves = fatten(exact, edges, self.window_px // 2, self.jump_px, view.rng("fattening"))
        images = disparity, lost, cosine, rendered.part.copy(), rendered.box.copy()
        for image in images:
            image.ravel()[moves.targets] = image.ravel()[moves.sources]
        lost |= lose_at_edges(edges, self.holes, view.rng("edges"))
        sky = disparity == 0
        noise = correlated_noise(disparity.shape, self.window_px, view.rng("matching"))
        noise *= self._sigma_px(disparity, cosine, scale)
        disparity += noise
        farthest_px = float(scale) / max(self.camera.min_depth_m, 0.1)
        mismatch(disparity, contrast, farthest_px, self.mismatches, view.rng("mismatches"))
        disparity *= np.float32(1 / self.step_px)
        steps = np.rint(disparity, out=disparity)
        np.maximum(steps, np.float32(0.5), out=steps)  # no match lies behind infinity
        depth_m = np.divide(scale / np.float32(self.step_px), steps, out=steps)
        depth_m[sky] = np.inf
        depth_m[lost] = np.nan
        return rendered._replace(depth_m=depth_m, part=images[3], box=images[4])

    def _sigma_px(self, disparity_px: Image, cosine: Image, scale: np.float32) -> Image | np.float32:
        """Return the standard deviation of disparity before it is rounded; published noise includes rounding."""
        rounding = self.step_px**2 / 12
        if self.axial.kind == "stereo":
            return np.float32(max(self.axial.disparity_px**2 - rounding, 0) ** 0.5)
        depth_m: Image = np.divide(scale, np.maximum(disparity_px, np.float32(1)))
        sigma = self.axial.sigma_m(depth_m, angles(cosine), 0.0)
        depth_m *= depth_m
        sigma /= depth_m
        sigma *= scale
        sigma *= sigma
        sigma -= np.float32(rounding)
        return np.sqrt(np.maximum(sigma, np.float32(0), out=sigma), out=sigma)

    def _light(self, view: View) -> tuple[Image, Image]:
        """Return the cosine of incidence, and the contrast of pattern and texture."""
        length = ray_lengths(view.intrinsics)
        cosine = cosines(view, length)
        surfaces = draw_surfaces(view)
        if self.emitter is None:
            return cosine, surfaces.texture
        length *= view.rendered.depth_m
        contrast = received(self.emitter, surfaces.albedo, cosine, length, view.conditions)
        if self.second_imager:
            contrast += surfaces.texture
        return cosine, contrast
