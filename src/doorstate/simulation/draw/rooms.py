# SPDX-License-Identifier: Apache-2.0
"""Random rooms on both sides of the wall."""

from __future__ import annotations

from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene.room import Space

BESIDE_M = 0.15  # least distance from the door or feature to a side wall
_AROUND_ROBOT_M = 0.45


def draw_near(stream: Stream, half_width_m: float, robot_x_m: float, robot_y_m: float) -> Space:
    """Draw a hall (25 %), a corridor along the wall (30 %) or a room (45 %), with space for the robot."""
    kind = stream.choice({"hall": 0.25, "corridor": 0.30, "room": 0.45})
    if kind == "hall":
        return Space()
    depth = robot_y_m + _AROUND_ROBOT_M + stream.uniform(0.0, 0.8 if kind == "corridor" else 2.5)
    if kind == "corridor":
        return Space(depth_m=round(depth, 4))
    beside = half_width_m + BESIDE_M
    left = max(beside, robot_x_m + _AROUND_ROBOT_M) + stream.uniform(0.0, 2.0)
    right = max(beside, -robot_x_m + _AROUND_ROBOT_M) + stream.uniform(0.0, 2.0)
    return Space(left_m=round(left, 4), right_m=round(right, 4), depth_m=round(depth, 4))


def draw_far(stream: Stream, half_width_m: float) -> Space:
    """Draw open space (25 %), a room 1.5 to 6 m deep with side walls (50 %), or a corridor of that width (25 %)."""
    kind = stream.choice({"nothing": 0.25, "corridor": 0.25, "room": 0.50})
    if kind == "nothing":
        return Space()
    depth = stream.uniform(1.5, 6.0)
    if kind == "corridor":
        return Space(depth_m=depth)
    sides = (round(half_width_m + BESIDE_M + stream.uniform(0.0, 2.5), 4) for _ in range(2))
    return Space(left_m=next(sides), right_m=next(sides), depth_m=depth)
