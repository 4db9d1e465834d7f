# SPDX-License-Identifier: Apache-2.0
"""Fixed parts of a door: jambs, casings, stop, threshold, the track of a sliding leaf, or the drum of a revolving door.

All are built with the hinge on the right and the leaf towards the robot; `door_boxes` mirrors them.
"""

from __future__ import annotations

from doorstate.simulation.scene.box import Box
from doorstate.simulation.scene.door import Door
from doorstate.simulation.scene.drum import drum_boxes
from doorstate.types import Part

SLIDING_OVERLAP_M = 0.03  # of a leaf in front of the wall, at both sides and above
_TRACK_M = 0.05


def frame_boxes(door: Door) -> list[Box]:
    """Return jambs, casings, stop, threshold and track, or the drum of a revolving door."""
    if door.kind == "revolving":
        return drum_boxes(door)
    half, height, wall = door.opening_width_m / 2, door.opening_height_m, door.wall_thickness_m
    jamb, casing, stop = door.jamb_thickness_m, door.casing_width_m, door.stop_width_m
    boxes = _portal(half, height, jamb, jamb, wall, -wall / 2)
    for face_y in (door.casing_thickness_m / 2, -wall - door.casing_thickness_m / 2):
        boxes += _portal(half, height, casing, casing, door.casing_thickness_m, face_y)
    # The leaf closes against the stop: flush, if not recessed, with the wall face on its hinge side.
    stop_y = -(door.leaf_recess_m + (door.leaf_thickness_m + door.stop_depth_m / 2))
    boxes += _portal(half - stop, height - stop, stop, stop, door.stop_depth_m, stop_y)
    if door.threshold_m:
        size = (door.opening_width_m, wall, door.threshold_m)
        boxes.append(Box(Part.FRAME, (0.0, -wall / 2, door.threshold_m / 2), size))
    if door.is_sliding and door.leaf_recess_m < 0:
        z = height + SLIDING_OVERLAP_M + _TRACK_M / 2
        size = (2 * door.opening_width_m, -door.leaf_recess_m, _TRACK_M)
        middle = 0.0 if door.kind == "sliding_double" else -half
        boxes.append(Box(Part.FRAME, (middle, -door.leaf_recess_m / 2, z), size))
    return boxes


def _portal(half_width: float, height: float, post: float, head: float, depth: float, y: float) -> list[Box]:
    """Return two posts and the head between them around a clear opening of 2 x half_width by height."""
    top = height + head
    return [
        *(
            Box(Part.FRAME, (sign * (half_width + post / 2), y, top / 2), (post, depth, top))
            for sign in (1, -1)
        ),
        Box(Part.FRAME, (0.0, y, height + head / 2), (2 * half_width, depth, head)),
    ]
