# SPDX-License-Identifier: Apache-2.0
"""Evidence for a direction up, from the usual properties of rooms and of cameras on robots.

Few surfaces are aslant, the floor has nothing below it and lies at a usual height, rooms are not higher than usual, the
ceiling is well above the camera, and cameras are mounted squarely, looking ahead rather than up or down.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from doorstate.clouds.up_directions import UpDirection
from doorstate.clouds.view_planes import Floats, ViewPlane

# Conditional logit (McFadden 1974) on simulated views of `varied`, `cluttered` and `no-door`, rounded.
WEIGHTS = {
    "aslant_share": -11.0,
    "aslant_count": -1.4,
    "floor": 1.7,
    "floor_share": 1.4,
    "below_floor": -13.0,
    "height": -3.2,
    "extent": -0.6,
    "ceiling": 0.6,
    "ceiling_height": -1.7,
    "pitch": -1.65,
    "square": 1.5,  # chosen
    "known_height": 4.0,  # chosen
}
HEIGHT_TOLERANCE_M = 0.12  # of a camera's height that is known
_MAX_ASLANT_SHARE, _MAX_ASLANT_COUNT = 0.3, 3
_MIN_HEIGHT_M = 0.08  # of a camera
_USUAL_HEIGHT_M, _RARE_HEIGHT_M = 1.4, 1.8  # of a camera, at most
_USUAL_EXTENT_M, _RARE_EXTENT_M = 3.2, 4.7  # of a room's height
_USUAL_CEILING_M = 1.7  # above the camera
_USUAL_PITCH_DEG = 30.0
_SQUARE_DEG = 4.0  # cameras are mounted squarely, unless on purpose
_BELOW_M, _MAX_BELOW_SHARE = 0.06, 0.1  # points below the floor
_EXTREME_SHARE = 0.01  # of the points; lower and higher ones are noise


def evidence(
    up: Floats,
    direction: UpDirection,
    planes: Sequence[ViewPlane],
    heights_m: Floats,
    camera_height_m: float | None = None,
) -> dict[str, float]:
    """Return the evidence for a direction up, by the names of `WEIGHTS`.

    Args:
        up: (3,) one end of the axis.
        direction: the axis, with the planes that agree.
        planes: planes of the view.
        heights_m: (M,) heights of points above the camera in this direction, ascending.
        camera_height_m: height of the camera above the floor, if it is known.
    """
    level = [
        (math.copysign(plane.distance_m, float(plane.normal @ up)), plane.share)
        for plane, is_level in zip(planes, direction.is_level, strict=True)
        if is_level
    ]
    floor_m, floor_share = min(level, default=(0.0, 0.0))
    ceiling_m = max(level, default=(0.0, 0.0))[0]
    shows_floor, shows_ceiling = floor_m < -_MIN_HEIGHT_M, ceiling_m > 0
    lowest_m, highest_m = np.interp((_EXTREME_SHARE, 1 - _EXTREME_SHARE), _ranks(heights_m), heights_m)
    height_m = -floor_m if shows_floor else max(0.0, -lowest_m)
    extent_m = height_m + max(0.0, highest_m, ceiling_m)
    below = np.searchsorted(heights_m, floor_m - _BELOW_M) / len(heights_m) if shows_floor else 0.0
    aslant = [
        plane.share
        for plane, agrees in zip(planes, direction.is_level | direction.is_upright, strict=True)
        if not agrees
    ]
    return {
        "aslant_share": min(sum(aslant) / sum(plane.share for plane in planes), _MAX_ASLANT_SHARE),
        "aslant_count": min(len(aslant), _MAX_ASLANT_COUNT),
        "floor": float(shows_floor),
        "floor_share": floor_share if shows_floor else 0.0,
        "below_floor": min(float(below), _MAX_BELOW_SHARE),
        "height": _ramp(height_m, _USUAL_HEIGHT_M, _RARE_HEIGHT_M),
        "extent": _ramp(extent_m, _USUAL_EXTENT_M, _RARE_EXTENT_M),
        "ceiling": float(shows_ceiling),
        "ceiling_height": min(math.log(ceiling_m / _USUAL_CEILING_M) ** 2, 4.0) if shows_ceiling else 0.0,
        "pitch": (math.degrees(math.asin(min(1.0, abs(float(up[0]))))) / _USUAL_PITCH_DEG) ** 2,
        "square": float(max(abs(up)) >= math.cos(math.radians(_SQUARE_DEG))),
        "known_height": _known_height(height_m, camera_height_m, shows_floor),
    }


def _known_height(height_m: float, camera_height_m: float | None, shows_floor: bool) -> float:
    """Return 1 for a floor at the known height, -1 for one elsewhere or for points below it."""
    if camera_height_m is None:
        return 0.0
    if shows_floor and abs(height_m - camera_height_m) <= HEIGHT_TOLERANCE_M:
        return 1.0
    return -1.0 if shows_floor or height_m > camera_height_m + HEIGHT_TOLERANCE_M else 0.0


def _ramp(value: float, start: float, end: float) -> float:
    return min(1.0, max(0.0, (value - start) / (end - start)))


def _ranks(values: Floats) -> Floats:
    return np.linspace(0, 1, len(values))
