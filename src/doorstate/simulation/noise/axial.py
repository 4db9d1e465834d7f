# SPDX-License-Identifier: Apache-2.0
"""Normal noise along the viewing axis, with a standard deviation that depends on depth and incidence."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.types import DepthImage

_STEEPEST_RAD = np.float32(math.radians(85.0))  # assumed: the published term is infinite at 90 degrees


class ConstantAxial(FrozenModel):
    """Normal noise with one standard deviation for all pixels."""

    kind: Literal["constant"] = "constant"
    deviation_m: float = Field(ge=0)

    def sigma_m(
        self, depth_m: DepthImage, incidence_rad: NDArray[np.float32], focal_px: float
    ) -> NDArray[np.float32]:
        """Return the standard deviation of each pixel.

        Args:
            depth_m: (H, W) metres.
            incidence_rad: (H, W), from `render.incidence`.
            focal_px: focal length of the camera.

        Returns:
            (H, W) metres.
        """
        return np.full(depth_m.shape, self.deviation_m, np.float32)


class NguyenAxial(FrozenModel):
    """Kinect v1 as measured by Nguyen, Izadi and Lovell 2012: s = a + b (z - c)^2, and beyond 60 degrees in addition
    d / sqrt(z) t^2 / (pi / 2 - t)^2 at incidence t.

    The measured deviation includes the sensor's disparity steps.
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
        """Return the standard deviation as `ConstantAxial.sigma_m` does; constant beyond 85 degrees."""
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
    """Stereo with sub-pixel precision p: s = p z^2 / (f b), Intel's formula for RealSense cameras (docs/sensors.md)."""

    kind: Literal["stereo"] = "stereo"
    baseline_m: float = Field(gt=0)
    disparity_px: float = Field(gt=0)

    def sigma_m(
        self, depth_m: DepthImage, incidence_rad: NDArray[np.float32], focal_px: float
    ) -> NDArray[np.float32]:
        """Return the standard deviation as `ConstantAxial.sigma_m` does."""
        return depth_m * depth_m * np.float32(self.disparity_px / (focal_px * self.baseline_m))


class FlightAxial(FrozenModel):
    """Time of flight as Fankhauser et al. 2015 measured the Kinect v2: s = a - b z + c z^2, plus
    d z^1.5 t^2 / (pi / 2 - t)^2 at incidence t.
    """

    kind: Literal["flight"] = "flight"
    base_m: float = 0.0015
    linear: float = -0.0005
    square_per_m: float = 0.0003
    steep_m: float = 0.0001

    def sigma_m(
        self, depth_m: DepthImage, incidence_rad: NDArray[np.float32], focal_px: float
    ) -> NDArray[np.float32]:
        """Return the standard deviation as `ConstantAxial.sigma_m` does; constant beyond 85 degrees."""
        sigma = depth_m * np.float32(self.square_per_m)
        sigma += np.float32(self.linear)
        sigma *= depth_m
        sigma += np.float32(self.base_m)
        angle = np.minimum(incidence_rad, _STEEPEST_RAD)
        left = np.float32(math.pi / 2) - angle
        angle /= left
        angle *= angle
        angle *= depth_m
        angle *= np.sqrt(depth_m, out=left)
        angle *= np.float32(self.steep_m)
        sigma += angle
        return sigma


Axial = ConstantAxial | NguyenAxial | StereoAxial


def add_noise(depth_m: DepthImage, sigma_m: NDArray[np.float32], rng: np.random.Generator) -> DepthImage:
    """Return depth plus normal noise with standard deviations (H, W); inf and NaN stay."""
    noise = rng.standard_normal(depth_m.shape, dtype=np.float32)
    noise *= sigma_m
    noise += depth_m
    return noise
