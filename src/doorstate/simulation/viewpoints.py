# SPDX-License-Identifier: Apache-2.0
"""Where the camera of a drawn scene is: anywhere on the half-ring, at any height, tilted a little."""

from __future__ import annotations

import math
from typing import NamedTuple

from doorstate.simulation.draws import Draws
from doorstate.simulation.placement import HEADING_JITTER_DEG
from doorstate.simulation.scene import Box
from doorstate.simulation.sensor import CameraPose
from doorstate.types import Part

_ROBOT_M = 0.5  # Pioneer 3-AT: 0.51 x 0.50 m
_OFF_WALL_M = 0.6


class Viewpoint(NamedTuple):
    """A camera in the door frame (scene.py); positive pitch looks down, positive roll turns the camera clockwise."""

    distance_m: float
    robot_angle_deg: float
    heading_offset_deg: float  # from the bearing to the door's middle
    camera_height_m: float
    pitch_deg: float
    roll_deg: float

    @property
    def x_m(self) -> float:
        """Along the wall."""
        return self.distance_m * math.cos(math.radians(self.robot_angle_deg))

    @property
    def y_m(self) -> float:
        """Off the wall."""
        return self.distance_m * math.sin(math.radians(self.robot_angle_deg))

    @property
    def heading_deg(self) -> float:
        """Yaw in the door frame."""
        return math.remainder(self.robot_angle_deg + 180 + self.heading_offset_deg, 360)

    def camera_pose(self) -> CameraPose:
        """The camera in the door frame."""
        at_m = self.x_m, self.y_m, self.camera_height_m
        return CameraPose.of_degrees(at_m, self.heading_deg, self.pitch_deg, self.roll_deg)

    def robot(self, margin_m: float = 0.0) -> Box:
        """The robot below its camera, as a block."""
        height = self.camera_height_m + 0.1
        side = _ROBOT_M + 2 * margin_m
        yaw = math.radians(self.heading_deg)
        return Box(Part.OTHER, (self.x_m, self.y_m, height / 2), (side, side, height), yaw)


def draw_viewpoint(draws: Draws) -> Viewpoint:
    """1.5 to 3.5 m from the door and at least 0.6 m off its wall, 0.25 to 1.2 m high; angles uniform."""
    distance = draws.between(1.5, 3.5)
    lowest_deg = math.degrees(math.asin(_OFF_WALL_M / distance))
    return Viewpoint(
        distance_m=distance,
        robot_angle_deg=draws.between(lowest_deg, 180 - lowest_deg),
        heading_offset_deg=draws.between(-HEADING_JITTER_DEG, HEADING_JITTER_DEG),
        camera_height_m=draws.between(0.25, 1.2),
        pitch_deg=draws.between(-10, 10),
        roll_deg=draws.between(-2, 2),
    )
