# SPDX-License-Identifier: Apache-2.0
"""Poses in plan view."""

from __future__ import annotations

import math
from typing import NamedTuple


class PlanePose(NamedTuple):
    """Place and direction in plan view; also the frame with its origin there and its x axis in that direction."""

    x_m: float
    y_m: float
    yaw_deg: float

    def after(self, inner: PlanePose) -> PlanePose:
        """Return a pose of this frame in the frame that this pose is given in."""
        cos, sin = math.cos(math.radians(self.yaw_deg)), math.sin(math.radians(self.yaw_deg))
        return PlanePose(
            self.x_m + cos * inner.x_m - sin * inner.y_m,
            self.y_m + sin * inner.x_m + cos * inner.y_m,
            turned_deg(self.yaw_deg + inner.yaw_deg),
        )

    def inverse(self) -> PlanePose:
        """Return the pose of the outer frame's origin in this frame."""
        cos, sin = math.cos(math.radians(self.yaw_deg)), math.sin(math.radians(self.yaw_deg))
        return PlanePose(
            -cos * self.x_m - sin * self.y_m, sin * self.x_m - cos * self.y_m, turned_deg(-self.yaw_deg)
        )


def turned_deg(angle_deg: float) -> float:
    """Return an angle above -180 and up to 180 degrees."""
    turned = math.remainder(angle_deg, 360.0)
    return 180.0 if turned == -180.0 else turned
