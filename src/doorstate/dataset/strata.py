# SPDX-License-Identifier: Apache-2.0
"""The paper's strata: four distance bands of 0.5 m and five angle regions between robot and door frame."""

from __future__ import annotations

import math

BANDS: tuple[str, ...] = ("1.5-2.0", "2.0-2.5", "2.5-3.0", "3.0-3.5")
REGIONS: dict[str, tuple[float, float]] = {  # degrees
    "orange": (0, 30),
    "red": (30, 60),
    "green": (60, 120),
    "yellow": (120, 150),
    "blue": (150, 180),
}
OUTSIDE = "outside"
_BAND_EDGES_M = (1.5, 2.0, 2.5, 3.0, 3.5)


def distance_band(distance_m: float) -> str:
    """Return the name of the band; an inner edge belongs to the farther band, 3.5 m to the last."""
    if not _BAND_EDGES_M[0] <= distance_m <= _BAND_EDGES_M[-1]:
        return OUTSIDE
    inner = sum(distance_m >= edge for edge in _BAND_EDGES_M[1:-1])
    return BANDS[inner]


def region(robot_angle_deg: float) -> str:
    """Return the name of the region; an inner edge belongs to the region nearer to the wall's normal."""
    if not 0 <= robot_angle_deg <= 180:
        return OUTSIDE
    beyond_normal = robot_angle_deg > 90
    return next(
        name
        for name, (_, high) in REGIONS.items()
        if robot_angle_deg < high or (beyond_normal and robot_angle_deg == high)
    )


def polar(x_m: float, y_m: float) -> tuple[float, float]:
    """Return distance (m) and angle (degrees, 0 along the wall to the left) of a robot in the door frame."""
    return round(math.hypot(x_m, y_m), 9), round(math.degrees(math.atan2(y_m, x_m)), 9)
