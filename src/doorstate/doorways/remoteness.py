# SPDX-License-Identifier: Apache-2.0
"""Order of the doors in a view: which one is most in front."""

from __future__ import annotations

import math

# Doors at this bearing count as twice as far away. Chosen: half of the usual view of a depth camera, so that a near
# door at its edge comes before one that is more than twice as far, straight ahead.
_DOUBLING_BEARING_DEG = 30.0


def remoteness_m(x_m: float, y_m: float) -> float:
    """Return the distance of a door, longer for doors beside the view's axis: that most in front has the smallest.

    At a bearing of 30 degrees it is twice the distance, at 60 degrees five times.

    Args:
        x_m: middle of the opening, forward of the camera.
        y_m: to its left.
    """
    bearing_deg = math.degrees(math.atan2(y_m, x_m))
    return math.hypot(x_m, y_m) * (1 + (bearing_deg / _DOUBLING_BEARING_DEG) ** 2)
