# SPDX-License-Identifier: Apache-2.0
"""Points in the frame of a true door."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from doorstate.simulation.truth import TrueDoor


def to_door_frame(points: NDArray[np.float32], door: TrueDoor) -> NDArray[np.float64]:
    """Return points (..., 3) of the sensor frame in the door's frame."""
    yaw = math.radians(door.yaw_deg)
    turn = np.array([[math.cos(yaw), math.sin(yaw), 0], [-math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]])
    return np.asarray((points - (door.x_m, door.y_m, door.floor_z_m)) @ turn.T)
