# SPDX-License-Identifier: Apache-2.0
"""Random flights of stairs along the walls of a stairwell."""

from __future__ import annotations

import math

from doorstate.simulation.draw.building.plan import Plan, turned
from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene.box import Pose
from doorstate.simulation.scene.stairs import Stairs

_ORIGIN = Pose(0.0, 0.0, 0.0)


def draw_stairs(stream: Stream, plan: Plan) -> Plan:
    """Return a stairwell with a flight up along its third wall, and often one down beside it.

    Both begin on a landing at one end of the room and lead to the other.
    """
    length, width = plan.layout.length_m, plan.layout.width_m
    flight = stream.uniform(0.95, min(1.4, width - 1.3))
    rise, going = stream.uniform(0.15, 0.185), stream.uniform(0.26, 0.31)
    landing = stream.uniform(0.0, 1.2)
    steps = max(3, min(int((length - landing - 1.3) / going), stream.integer(7, 11)))
    landing = min(landing, max(0.0, length - steps * going - 1.2))
    run = steps * going + landing
    towards_x = stream.chance(0.5)
    start = length - run if towards_x else run
    yaw = -math.pi / 2 if towards_x else math.pi / 2
    rails = (False, True) if towards_x else (True, False)
    up = _stairs(Pose(start, width - flight / 2 - 0.01, yaw), flight, going, rise, (steps, landing), rails)
    stairs = [up]
    if width - 2 * flight > 1.25 and stream.chance(0.5):
        down = _stairs(
            Pose(start, width - 1.5 * flight - 0.15, yaw), flight, going, -rise, (steps, landing), rails
        )
        stairs.append(down)
    return plan._replace(stairs=tuple(stairs))


def _stairs(
    pose: Pose, width: float, going: float, rise: float, run: tuple[int, float], rails: tuple[bool, bool]
) -> Stairs:
    x_m, y_m, yaw_deg = turned(pose, _ORIGIN)
    return Stairs(
        x_m=x_m,
        y_m=y_m,
        yaw_deg=yaw_deg,
        width_m=round(width - 0.02, 4),
        going_m=going,
        rise_m=rise,
        steps=run[0],
        landing_m=round(run[1], 4),
        rails=rails,
    )
