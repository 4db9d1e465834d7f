# SPDX-License-Identifier: Apache-2.0
"""Doors of a list that a camera may take for each other."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from doorstate.doors.camera_place import CameraPlace
from doorstate.doors.matching import expected_door, match_doors
from doorstate.doors.named_door import NamedDoor
from doorstate.doors.plane_pose import PlanePose
from doorstate.inference.door import Door

_AHEAD_M = 3.0  # of the camera before a door


def alike_doors(
    doors: Sequence[NamedDoor], position_error_m: float, yaw_error_deg: float
) -> Iterator[tuple[NamedDoor, NamedDoor]]:
    """Yield pairs of doors that are not told apart where a camera 3 m before the one sees it alone, at its place.

    Args:
        doors: doors of a list.
        position_error_m, yaw_error_deg: standard errors of the camera's pose.
    """
    for number, door in enumerate(doors):
        x_m, y_m, yaw_deg = door.place.after(PlanePose(0.0, _AHEAD_M, -90.0))
        camera = CameraPlace(PlanePose(x_m, y_m, yaw_deg), door.frame, position_error_m, yaw_error_deg)
        seen = Door(
            *expected_door(door, camera), door.width_m, None, position_error_m=0.05, yaw_error_deg=2.0
        )
        reach_m = _AHEAD_M + 5 * (position_error_m + _AHEAD_M * math.radians(yaw_error_deg))
        near = [
            other
            for other in range(len(doors))
            if math.dist(doors[other].place[:2], door.place[:2]) <= reach_m
        ]
        candidates = match_doors([seen], [doors[other] for other in near], camera)[0].candidates
        for other in (near[candidate] for candidate in candidates):
            if other > number:
                yield door, doors[other]
