# SPDX-License-Identifier: Apache-2.0
"""Camera positions in front of the door."""

from __future__ import annotations

import math
from typing import NamedTuple

from doorstate.simulation.camera import CameraPose
from doorstate.simulation.draw.half_ring import HEADING_JITTER_DEG, Position
from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene.box import Box
from doorstate.types import Part

_ROBOT_M = 0.5  # Pioneer 3-AT: 0.51 x 0.50 m
_OFF_WALL_M = 0.6


class Viewpoint(NamedTuple):
    """A camera in the door frame; positive pitch looks down, positive roll turns the camera clockwise."""

    x_m: float
    y_m: float
    camera_height_m: float
    heading_deg: float
    heading_rad: float  # as drawn: degrees converted to radians may differ in the last bit
    heading_offset_deg: float  # from the bearing to the door's middle
    pitch_deg: float
    roll_deg: float
    distance_m: float
    robot_angle_deg: float

    @classmethod
    def on_lattice(
        cls, position: Position, heading_offset_deg: float, camera_height_m: float = 1.0
    ) -> Viewpoint:
        """Return a level camera above a lattice position of the half-ring."""
        heading_rad = math.atan2(-position.row, -position.column) + math.radians(heading_offset_deg)
        return cls(
            x_m=position.x_m,
            y_m=position.y_m,
            camera_height_m=camera_height_m,
            heading_deg=math.degrees(heading_rad),
            heading_rad=heading_rad,
            heading_offset_deg=heading_offset_deg,
            pitch_deg=0.0,
            roll_deg=0.0,
            distance_m=round(math.hypot(position.x_m, position.y_m), 9),
            robot_angle_deg=round(math.degrees(math.atan2(position.row, position.column)), 9),
        )

    def camera_pose(self) -> CameraPose:
        """Return the camera in the door frame."""
        position_m = self.x_m, self.y_m, self.camera_height_m
        return CameraPose.from_degrees(position_m, self.heading_deg, self.pitch_deg, self.roll_deg)

    def robot_box(self, margin_m: float = 0.0) -> Box:
        """Return the robot below its camera as one box, enlarged by a margin on each side."""
        height = self.camera_height_m + 0.1
        side = _ROBOT_M + 2 * margin_m
        yaw = math.radians(self.heading_deg)
        return Box(Part.OTHER, (self.x_m, self.y_m, height / 2), (side, side, height), yaw)


def draw_viewpoint(stream: Stream) -> Viewpoint:
    """Draw a camera 1.5 to 3.5 m from the door, at least 0.6 m off its wall, 0.25 to 1.2 m high, slightly tilted."""
    distance = stream.uniform(1.5, 3.5)
    lowest_deg = math.degrees(math.asin(_OFF_WALL_M / distance))
    robot_angle = stream.uniform(lowest_deg, 180 - lowest_deg)
    heading_offset = stream.uniform(-HEADING_JITTER_DEG, HEADING_JITTER_DEG)
    heading = math.remainder(robot_angle + 180 + heading_offset, 360)
    return Viewpoint(
        x_m=distance * math.cos(math.radians(robot_angle)),
        y_m=distance * math.sin(math.radians(robot_angle)),
        camera_height_m=stream.uniform(0.25, 1.2),
        heading_deg=heading,
        heading_rad=math.radians(heading),
        heading_offset_deg=heading_offset,
        pitch_deg=stream.uniform(-10, 10),
        roll_deg=stream.uniform(-2, 2),
        distance_m=distance,
        robot_angle_deg=robot_angle,
    )
