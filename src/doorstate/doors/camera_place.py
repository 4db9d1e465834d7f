# SPDX-License-Identifier: Apache-2.0
"""Pose of a camera in a map at a moment, and the interface of everything that knows it: a file, tf, a localisation."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from doorstate.doors.named_door import DEFAULT_FRAME
from doorstate.doors.plane_pose import PlanePose

POSITION_ERROR_M, YAW_ERROR_DEG = 0.1, 3.0  # chosen: of a robot that is localised by a laser


class CameraPlace(NamedTuple):
    """Pose of the level sensor frame in a map: place of the camera and heading of its view, in plan view."""

    pose: PlanePose
    frame: str = DEFAULT_FRAME  # of the map
    position_error_m: float = POSITION_ERROR_M  # standard error of x, and of y
    yaw_error_deg: float = YAW_ERROR_DEG


class MissingPlace(NamedTuple):
    """Reason why the pose of a camera is not known at a moment."""

    reason: str


class CameraPlaces(Protocol):
    """Poses of a camera over time."""

    def at(self, stamp_s: float) -> CameraPlace | MissingPlace:
        """Return the pose at a moment, on the clock of the clouds."""
