# SPDX-License-Identifier: Apache-2.0
"""Direction of gravity from a camera's accelerometer, and the tilt that follows from it.

An accelerometer at rest measures the force that holds it: 9.8 m/s2 upwards. A robot that speeds up adds its own, so
readings of another length are left out, and the others are averaged: a second of 0.5 m/s2 tilts them by a degree.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from doorstate.cameras.device import Vector
from doorstate.errors import CameraError

GRAVITY_M_S2 = 9.81
MAX_TILT_DEG = 45.0
_TOLERANCE_M_S2 = 0.6  # accelerometers that were never calibrated are off by up to 0.4 (librealsense #6016)
_MEMORY_S = 2.0
_MAX_AGE_S = 3.0
_LEAST_SAMPLES = 5


class GravityFilter:
    """Average of an accelerometer over the last seconds."""

    def __init__(self) -> None:
        self._mean: NDArray[np.float64] | None = None
        self._last_s = -math.inf
        self._samples = 0

    def add(self, force_m_s2: NDArray[np.float64], time_s: float) -> None:
        """Add a reading (3,) in the optical frame; one that is not gravity alone is left out."""
        if not abs(float(np.linalg.norm(force_m_s2)) - GRAVITY_M_S2) <= _TOLERANCE_M_S2:  # also for NaN
            return
        if self._mean is None or not 0 <= time_s - self._last_s <= _MAX_AGE_S:
            self._mean, self._samples = np.zeros(3), 0
        self._samples += 1
        # The first readings count alike; later the average forgets.
        weight = max(1 / self._samples, 1 - math.exp(-(time_s - self._last_s) / _MEMORY_S))
        self._mean = self._mean + min(1.0, weight) * (force_m_s2 - self._mean)
        self._last_s = time_s

    def up(self, time_s: float) -> Vector | None:
        """Return the unit vector upwards; None without enough readings of the last seconds."""
        is_fresh = 0 <= time_s - self._last_s <= _MAX_AGE_S
        if self._mean is None or not is_fresh or self._samples < _LEAST_SAMPLES:
            return None
        x, y, z = (self._mean / np.linalg.norm(self._mean)).tolist()
        return x, y, z


def tilt_of(up: Vector) -> tuple[float, float]:
    """Return roll and pitch in degrees (`io.rotations`) of a camera by the direction upwards in its optical frame.

    Raises:
        CameraError: more than 45 degrees, which is likelier a driver with other axes than a camera.
    """
    forward, left, upward = up[2], -up[0], -up[1]  # x forward, y left, z up
    pitch_deg = math.degrees(-math.asin(max(-1.0, min(1.0, forward))))
    roll_deg = math.degrees(math.atan2(left, upward))
    if max(abs(pitch_deg), abs(roll_deg)) > MAX_TILT_DEG:
        raise CameraError(
            f"the accelerometer tells a pitch of {pitch_deg:.0f} and a roll of {roll_deg:.0f} degrees",
            expected=f"at most {MAX_TILT_DEG:g}",
        )
    return roll_deg, pitch_deg
