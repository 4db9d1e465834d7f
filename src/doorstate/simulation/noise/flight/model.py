# SPDX-License-Identifier: Apache-2.0
"""Sensor that measures the time of flight of modulated light (docs/sensors.md)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.io.camera import Intrinsics
from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.noise.axial import FlightAxial
from doorstate.simulation.noise.edges import Edges, blur_edges
from doorstate.simulation.noise.flight.multipath import Multipath, multipath_bias
from doorstate.simulation.noise.flight.wiggling import Wiggling, wiggle
from doorstate.simulation.noise.optical import (
    WHITE,
    Emitter,
    Image,
    View,
    angles,
    cosines,
    dimming,
    draw_surfaces,
    ray_lengths,
    received,
)
from doorstate.simulation.noise.quantisation import DepthSteps, round_depth
from doorstate.simulation.noise.returns import Returns, reflect
from doorstate.simulation.noise.windows import correlated_noise
from doorstate.simulation.render import Render

_NOISIEST = 20.0  # assumed: noise is at most this times that on a white wall


class FlightModel(FrozenModel):
    """A camera and its light."""

    kind: Literal["flight"] = "flight"
    name: str
    camera: DepthCamera
    emitter: Emitter
    axial: FlightAxial
    wiggling: Wiggling
    multipath: Multipath = Multipath()
    edges: Edges = Edges(lost=0.3, flying=0.8)  # assumed
    weak_spread: float = Field(default=0.3, ge=0)  # assumed: deviation of the light that a pixel needs
    returns: Returns = Returns(glass_lost=0.3, glass_behind=0.5)
    lit_radius_px: float | None = None  # of the circle that the emitter lights
    steps: DepthSteps = DepthSteps(step_m=0.001, bits=16)

    def distort(self, view: View) -> Render:
        """Return the measurement before the range is cut: inf where nothing is hit, NaN where light is too weak."""
        pinhole = view.intrinsics
        length = ray_lengths(pinhole)
        cosine = cosines(view, length)
        surfaces = draw_surfaces(view)
        bias_m = multipath_bias(view, surfaces.albedo, cosine, self.multipath)
        rendered = reflect(self.returns, view, cosine)
        surface_m = rendered.depth_m
        finite = np.isfinite(surface_m)
        depth_m = np.where(finite, surface_m, np.float32(1))
        distance_m = depth_m * length
        light = received(self.emitter, surfaces.albedo, cosine, distance_m, view.conditions)
        noise = self.sigma_m(depth_m, surfaces.albedo, cosine, view)
        error_m = wiggle(distance_m, self.wiggling, view.rng("wiggling"))
        error_m += bias_m
        error_m /= length
        noise *= view.rng("flight").standard_normal(depth_m.shape, dtype=np.float32)
        error_m += noise
        depth_m += error_m
        depth_m = np.where(finite, depth_m, surface_m)
        depth_m = blur_edges(depth_m, surface_m, self.edges, view.rng("edges"))
        needed = correlated_noise(light.shape, 3, view.rng("weak"))
        needed *= np.float32(self.weak_spread)
        needed += np.float32(1)
        depth_m[(light < needed) & finite] = np.nan
        if self.lit_radius_px is not None:
            depth_m[_beyond(self.lit_radius_px, pinhole)] = np.nan
        return rendered._replace(depth_m=_rounded(depth_m, self.steps))

    def sigma_m(self, depth_m: Image, albedo: Image, cosine: Image, view: View) -> Image:
        """Return the standard deviation (H, W): that of a white wall, more on darker surfaces and in sunlight."""
        sigma = self.axial.sigma_m(depth_m, angles(cosine), view.intrinsics.fx)
        # Shot noise of the ambient light grows with its root.
        scale = np.float32(WHITE * dimming(self.emitter, view.conditions) ** 0.5)
        sigma *= np.minimum(scale / np.maximum(albedo, np.float32(0.01)), np.float32(_NOISIEST))
        return sigma


def _beyond(radius_px: float, pinhole: Intrinsics) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    right = np.arange(pinhole.width) - pinhole.cx
    down = np.arange(pinhole.height) - pinhole.cy
    return right * right + (down * down)[:, None] > radius_px**2


def _rounded(depth_m: Image, steps: DepthSteps) -> Image:
    """Round what is measured; a ray that hits nothing stays inf."""
    return np.where(np.isposinf(depth_m), depth_m, round_depth(depth_m, steps))
