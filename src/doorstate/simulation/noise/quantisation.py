# SPDX-License-Identifier: Apache-2.0
"""Steps: of disparity, as the sensor matches it, and of depth, as a file keeps it."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.types import DepthImage


class DisparitySteps(FrozenModel):
    """Disparity f b / z in whole steps; depth then has steps of about z^2 step / (f b)."""

    baseline_m: float = Field(gt=0)
    step_px: float = Field(gt=0)

    def step_m(self, depth_m: DepthImage, focal_px: float) -> DepthImage:
        """Distance between neighbouring depths."""
        return depth_m * depth_m * np.float32(self.step_px / (focal_px * self.baseline_m))


class DepthSteps(FrozenModel):
    """Depth in whole steps, kept in a number of bits."""

    step_m: float = Field(gt=0)
    bits: int = Field(ge=1)


def round_disparity(depth_m: DepthImage, steps: DisparitySteps, focal_px: float) -> DepthImage:
    """Depth of the nearest whole step of disparity; inf and NaN stay."""
    scale = np.float32(focal_px * steps.baseline_m / steps.step_px)
    with np.errstate(divide="ignore"):  # less than half a step is infinitely far
        rounded: DepthImage = scale / np.rint(scale / depth_m)
    return rounded


def round_depth(depth_m: DepthImage, steps: DepthSteps) -> DepthImage:
    """The nearest whole step; NaN where that is 0, which files keep for nothing, or more than the bits hold."""
    whole = np.rint(depth_m / np.float32(steps.step_m))
    kept = (whole >= 1) & (whole < 2**steps.bits)
    return np.where(kept, whole * np.float32(steps.step_m), np.float32(np.nan))
