# SPDX-License-Identifier: Apache-2.0
"""Noise along the viewing axis: normal, with a standard deviation that depends on depth and incidence."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.types import DepthImage

_STEEPEST_RAD = np.float32(math.radians(85.0))  # chosen: the published term is infinite at 90 degrees


class ConstantAxial(FrozenModel):
    """The same everywhere."""

    kind: Literal["constant"] = "constant"
    deviation_m: float = Field(ge=0)

    def sigma_m(
        self, depth_m: DepthImage, incidence_rad: NDArray[np.float32], focal_px: float
    ) -> NDArray[np.float32]:
        """Standard deviation of each pixel.

        Args:
            depth_m: (H, W) metres.
            incidence_rad: (H, W), of `sensor.incidence`.
            focal_px: of the camera.

        Returns:
            (H, W) metres.
        """
        return np.full(depth_m.shape, self.deviation_m, np.float32)


class NguyenAxial(FrozenModel):
    """Kinect v1 as Nguyen, Izadi and Lovell 2012 measured it: s = a + b (z - c)^2, beyond 60 degrees with
    d / sqrt(z) t^2 / (pi / 2 - t)^2 at incidence t.

    They measured what the sensor gave, its steps of disparity and all.
    """

    kind: Literal["nguyen"] = "nguyen"
    base_m: float = 0.0012
    square_per_m: float = 0.0019
    nearest_m: float = 0.4
    steep_m: float = 0.0001
    steep_from_deg: float = 60.0

    def sigma_m(
        self, depth_m: DepthImage, incidence_rad: NDArray[np.float32], focal_px: float
    ) -> NDArray[np.float32]:
        """As `ConstantAxial.sigma_m`; beyond 85 degrees that at 85."""
        sigma = depth_m - np.float32(self.nearest_m)
        sigma *= sigma
        sigma *= np.float32(self.square_per_m)
        sigma += np.float32(self.base_m)
        steep = incidence_rad > np.float32(math.radians(self.steep_from_deg))
        angle = np.minimum(incidence_rad[steep], _STEEPEST_RAD)
        ratio = angle / (np.float32(math.pi / 2) - angle)
        sigma[steep] += np.float32(self.steep_m) / np.sqrt(depth_m[steep]) * ratio * ratio
        return sigma


class StereoAxial(FrozenModel):
    """Stereo of sub-pixel precision p: s = p z^2 / (f b), as Intel states it for RealSense cameras (SIMULATION 3.1)."""

    kind: Literal["stereo"] = "stereo"
    baseline_m: float = Field(gt=0)
    disparity_px: float = Field(gt=0)

    def sigma_m(
        self, depth_m: DepthImage, incidence_rad: NDArray[np.float32], focal_px: float
    ) -> NDArray[np.float32]:
        """As `ConstantAxial.sigma_m`."""
        return depth_m * depth_m * np.float32(self.disparity_px / (focal_px * self.baseline_m))


Axial = ConstantAxial | NguyenAxial | StereoAxial


def add_noise(depth_m: DepthImage, sigma_m: NDArray[np.float32], rng: np.random.Generator) -> DepthImage:
    """Depth plus normal noise of a standard deviation (H, W); what is not finite stays."""
    noise = rng.standard_normal(depth_m.shape, dtype=np.float32)
    noise *= sigma_m
    noise += depth_m
    return noise
