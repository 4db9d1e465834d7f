# SPDX-License-Identifier: Apache-2.0
"""Pose and width of a candidate doorway, and its frame."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.coordinates import coordinates
from doorstate.types import Points


class Placed(Protocol):
    """Opening with a place in the level sensor frame: a candidate, a door or a true one."""

    @property
    def x_m(self) -> float:
        """Middle of the opening."""

    @property
    def y_m(self) -> float:
        """Middle of the opening."""

    @property
    def yaw_deg(self) -> float:
        """Direction of the wall."""


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


def gap(first: Placed, second: Placed) -> tuple[float, float]:
    """Return the distance in metres between the middles of two openings, and the angle in degrees of their walls."""
    turn_deg = abs(math.remainder(first.yaw_deg - second.yaw_deg, 360))
    return math.hypot(first.x_m - second.x_m, first.y_m - second.y_m), turn_deg
