# SPDX-License-Identifier: Apache-2.0
"""Quantisation: of disparity by the sensor, and of depth by a file format."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.types import DepthImage


class DisparitySteps(FrozenModel):
    """Disparity f b / z in multiples of a step; depth then has steps of about z^2 step / (f b)."""

    baseline_m: float = Field(gt=0)
    step_px: float = Field(gt=0)

    def step_m(self, depth_m: DepthImage, focal_px: float) -> DepthImage:
        """Return the distance between neighbouring depths."""
        return depth_m * depth_m * np.float32(self.step_px / (focal_px * self.baseline_m))


class DepthSteps(FrozenModel):
    """Depth in multiples of a step, stored in a number of bits."""

    step_m: float = Field(gt=0)
    bits: int = Field(ge=1)


def round_disparity(depth_m: DepthImage, steps: DisparitySteps, focal_px: float) -> DepthImage:
    """Round depth to the nearest step of disparity; inf and NaN stay."""
    scale = np.float32(focal_px * steps.baseline_m / steps.step_px)
    with np.errstate(divide="ignore"):  # less than half a step rounds to infinity
        rounded: DepthImage = scale / np.rint(scale / depth_m)
    return rounded


def round_depth(depth_m: DepthImage, steps: DepthSteps) -> DepthImage:
    """Round depth to the nearest step; NaN where that is 0, the code for no measurement, or exceeds the bits."""
    whole = np.rint(depth_m / np.float32(steps.step_m))
    kept = (whole >= 1) & (whole < 2**steps.bits)
    return np.where(kept, whole * np.float32(steps.step_m), np.float32(np.nan))
