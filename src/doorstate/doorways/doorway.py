# SPDX-License-Identifier: Apache-2.0
"""Pose and width of a candidate doorway, and its frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.coordinates import coordinates
from doorstate.types import Points


@dataclass(frozen=True)
class Doorway:
    """Candidate doorway in a level cloud, sensor frame.

    The doorway's frame has its origin on the floor in the middle of the opening, on the wall's face towards the camera;
    x points along the wall to the left as the camera sees it, y towards the camera, z up. It is the door frame of the
    simulator.
    """

    x_m: float  # middle of the opening
    y_m: float
    yaw_deg: float  # of the doorway's x axis; a wall straight ahead has 90
    width_m: float
    floor_z_m: float
    score: float = 0.0  # higher is more like a doorway

    @property
    def distance_m(self) -> float:
        """Distance from the camera to the middle of the opening in plan view."""
        return math.hypot(self.x_m, self.y_m)

    def gap_to(self, x_m: float, y_m: float, yaw_deg: float) -> tuple[float, float]:
        """Return the distance in metres to another opening's middle, and the angle in degrees to its wall."""
        return math.hypot(self.x_m - x_m, self.y_m - y_m), abs(math.remainder(self.yaw_deg - yaw_deg, 360))

    def to_doorway(self, points: Points) -> Points:
        """Return points (..., 3) of the sensor frame in the doorway's frame, float32."""
        moved = coordinates(points) - np.array([[self.x_m], [self.y_m], [self.floor_z_m]], np.float32)
        turned: Points = (self._axes() @ moved).T.reshape(points.shape)
        return turned

    def to_sensor(self, points: Points) -> Points:
        """Return points (..., 3) of the doorway's frame in the sensor frame, float32."""
        turned: Points = points @ self._axes() + np.array([self.x_m, self.y_m, self.floor_z_m], np.float32)
        return turned

    def _axes(self) -> NDArray[np.float32]:
        """Return the axes of the doorway's frame as rows (3, 3) in the sensor frame."""
        cos, sin = math.cos(math.radians(self.yaw_deg)), math.sin(math.radians(self.yaw_deg))
        return np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]], np.float32)
