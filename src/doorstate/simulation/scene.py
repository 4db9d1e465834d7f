# SPDX-License-Identifier: Apache-2.0
"""A door in a wall, as boxes.

Door frame: origin in the middle of the opening, on the floor, on the robot's face of the wall; x along the wall, y from
the wall to the robot, z up. Seen by somebody who looks at the wall, left is +x.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

from doorstate._models import FrozenModel
from doorstate.types import Part

Hinge = Literal["left", "right"]
Swing = Literal["away", "towards"]
Material = Literal[
    "matte", "gloss", "dark", "glass"
]  # what it does to a depth camera (simulation.noise.materials)


class Box(NamedTuple):
    """An upright box; `center_m` and `size_m` are (x, y, z), `yaw_rad` turns it about z."""

    part: Part
    center_m: tuple[float, float, float]
    size_m: tuple[float, float, float]
    yaw_rad: float = 0.0
    material: Material = "matte"


class Door(FrozenModel):
    """A single hinged door and the wall around it; sizes are those of SIMULATION section 4, all assumed.

    The authors state none of them. Opening 0.90 x 2.10 m, wall 0.15 m and leaf 0.04 m are usual in Turkey.
    """

    opening_width_m: float = 0.90
    opening_height_m: float = 2.10
    hinge: Hinge = "left"
    swing: Swing = "towards"
    leaf_thickness_m: float = 0.04
    leaf_gap_m: float = 0.003  # to the jambs and the head
    leaf_floor_gap_m: float = 0.006
    wall_thickness_m: float = 0.15
    wall_height_m: float = 2.6
    wall_half_length_m: float = 6.0
    jamb_thickness_m: float = 0.03
    casing_width_m: float = 0.06
    casing_thickness_m: float = 0.015
    stop_width_m: float = 0.012  # how far the stop stands out of the jamb
    stop_depth_m: float = 0.03
    floor_size_m: float = 16.0


_SLAB_M = 0.1  # thickness of the floor box


def build_scene(door: Door, opening_angle_rad: float) -> list[Box]:
    """All boxes of a door in its wall, on a floor, with open space behind.

    Args:
        door: sizes, hinge side and swing.
        opening_angle_rad: 0 is closed; measured at the hinge.

    Returns:
        Boxes in the door frame.
    """
    return [
        *wall_boxes(door),
        *frame_boxes(door),
        _leaf(door, opening_angle_rad),
        floor_box(door.floor_size_m),
    ]


def wall_boxes(door: Door) -> list[Box]:
    """The wall on both sides of the opening and above it."""
    inner = door.opening_width_m / 2 + door.jamb_thickness_m
    top = door.opening_height_m + door.jamb_thickness_m
    length = door.wall_half_length_m - inner
    y = -door.wall_thickness_m / 2
    side = (length, door.wall_thickness_m, door.wall_height_m)
    lintel = (2 * inner, door.wall_thickness_m, door.wall_height_m - top)
    return [
        *(Box(Part.WALL, (sign * (inner + length / 2), y, door.wall_height_m / 2), side) for sign in (1, -1)),
        Box(Part.WALL, (0.0, y, (top + door.wall_height_m) / 2), lintel),
    ]


def frame_boxes(door: Door, leaf_recess_m: float = 0.0) -> list[Box]:
    """Jambs, casings and the stop; the closed leaf lies `leaf_recess_m` behind the face that it swings out of."""
    half, height, wall = door.opening_width_m / 2, door.opening_height_m, door.wall_thickness_m
    jamb, casing, stop = door.jamb_thickness_m, door.casing_width_m, door.stop_width_m
    boxes = _portal(half, height, jamb, jamb, wall, -wall / 2)
    for face_y in (door.casing_thickness_m / 2, -wall - door.casing_thickness_m / 2):
        boxes += _portal(half, height, casing, casing, door.casing_thickness_m, face_y)
    # The leaf closes against the stop: flush, if not recessed, with the wall face on its hinge side.
    inset = leaf_recess_m + (door.leaf_thickness_m + door.stop_depth_m / 2)
    stop_y = inset - wall if door.swing == "away" else -inset
    return boxes + _portal(half - stop, height - stop, stop, stop, door.stop_depth_m, stop_y)


def _portal(half_width: float, height: float, post: float, head: float, depth: float, y: float) -> list[Box]:
    """Two posts and the head between them around a clear opening of 2 x half_width by height."""
    top = height + head
    return [
        *(
            Box(Part.FRAME, (sign * (half_width + post / 2), y, top / 2), (post, depth, top))
            for sign in (1, -1)
        ),
        Box(Part.FRAME, (0.0, y, height + head / 2), (2 * half_width, depth, head)),
    ]


def _leaf(door: Door, opening_angle_rad: float) -> Box:
    width = door.opening_width_m - 2 * door.leaf_gap_m
    height = door.opening_height_m - door.leaf_gap_m - door.leaf_floor_gap_m
    side = 1.0 if door.hinge == "left" else -1.0
    away = door.swing == "away"
    # The hinge axis is the leaf's edge on the wall face that it swings out of.
    hinge_x = side * width / 2
    hinge_y = -door.wall_thickness_m if away else 0.0
    inward = 1.0 if away else -1.0
    turn = side * inward * opening_angle_rad
    cos, sin = math.cos(turn), math.sin(turn)
    closed_x, closed_y = -side * width / 2, inward * door.leaf_thickness_m / 2
    center_x = hinge_x + closed_x * cos - closed_y * sin
    center_y = hinge_y + closed_x * sin + closed_y * cos
    center = (center_x, center_y, door.leaf_floor_gap_m + height / 2)
    return Box(Part.LEAF, center, (width, door.leaf_thickness_m, height), turn)


def floor_box(size_m: float) -> Box:
    """A square floor."""
    return Box(Part.FLOOR, (0.0, 0.0, -_SLAB_M / 2), (size_m, size_m, _SLAB_M))
