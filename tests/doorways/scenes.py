# SPDX-License-Identifier: Apache-2.0
"""Scenes made by hand of views that are easily taken for something else, with the doors that are in them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from doorstate.io.depth import depth_to_points
from doorstate.simulation.camera import CAMERAS, CameraPose
from doorstate.simulation.frames import level
from doorstate.simulation.render import Render, cut_range, is_made_of, keep, render_behind_glass
from doorstate.simulation.scene import Box, Door, Opening, Scene, scene_boxes
from doorstate.simulation.scene.box import Pose
from doorstate.simulation.scene.feature import Feature
from doorstate.simulation.scene.handle import Handle
from doorstate.simulation.scene.room import Space
from doorstate.simulation.true_door import TrueDoor, describe_door
from doorstate.types import Part, Points

CAMERA = CAMERAS["xtion-gazebo"]
LEVER = Handle(kind="lever", height_m=1.0, projection_m=0.06, length_m=0.13)
WALL = Feature(kind="wall", wall_thickness_m=0.15, wall_height_m=2.6)
ROOM = Space(left_m=2.5, right_m=2.5, depth_m=4.5)


@dataclass(frozen=True)
class HandMade:
    """Boxes, the camera that sees them in the same frame, and the true doors in the level sensor frame."""

    boxes: Sequence[Box]
    pose: CameraPose
    doors: tuple[TrueDoor, ...] = ()

    @cached_property
    def view(self) -> Render:
        """Rendering in the camera's range; dark surfaces return nothing, and glass is seen through."""
        full = render_behind_glass(self.boxes, self.pose, CAMERA.intrinsics())
        return cut_range(keep(full, ~is_made_of("dark", full, self.boxes)), CAMERA)

    @cached_property
    def points(self) -> Points:
        """Level cloud (H, W, 3) of the sensor frame, NaN where nothing was measured."""
        points = depth_to_points(self.view.depth_m, CAMERA.intrinsics())
        return level(points, self.pose.pitch_rad, self.pose.roll_rad)

    @property
    def floor_z_m(self) -> float:
        """Height of the floor in the level sensor frame."""
        return -self.pose.z_m


def closed_door_beside_free_corridor() -> HandMade:
    """Return a closed door in the right-hand wall of a corridor that is free ahead."""
    return _with_door(Door(handle=LEVER), 0.0, (-2.2, 0.95), 0.0, near=Space(depth_m=1.8))


def leaf_square_in_the_room() -> HandMade:
    """Return an open leaf seen face on, 4 m off, whose opening is in the right-hand wall."""
    door = Door(hinge="left", handle=LEVER)
    near = Space(left_m=2.5, right_m=5.0, depth_m=3.0)
    return _with_door(door, 90.0, (-3.6, 1.2), -8.0, near=near)


def doorway_at_the_edge_of_a_rolled_view() -> HandMade:
    """Return a closed door at the left edge of a view that is rolled by 15 degrees."""
    return _with_door(Door(handle=LEVER), 0.0, (-1.1, 2.3), -90.0, roll_deg=15.0)


def closed_door_in_a_recess_beside_a_fridge() -> HandMade:
    """Return a closed door between the side of a recess, 0.6 m deep, and a fridge."""
    side = Box(Part.WALL, (-1.75, 0.3, 1.3), (2.2, 0.6, 2.6))
    fridge = Box(Part.OTHER, (0.87, 0.34, 0.925), (0.60, 0.65, 1.85))
    return _with_door(Door(handle=LEVER), 0.0, (0.5, 2.8), -102.0, extra=(side, fridge))


def lower_leaf_from_near_the_floor() -> HandMade:
    """Return a semi-open door of which a robot 0.2 m high sees the lower leaf only."""
    return _with_door(Door(swing="away", handle=LEVER), 40.0, (0.1, 1.1), -92.0, height_m=0.2)


def table_football() -> HandMade:
    """Return table football before a bare wall."""
    boxes = [
        Box(Part.OTHER, (0.0, 1.0, 0.75), (1.40, 0.75, 0.30)),
        *(Box(Part.OTHER, (x, y, 0.3), (0.10, 0.10, 0.6)) for x in (-0.6, 0.6) for y in (0.72, 1.28)),
        *(
            Box(Part.OTHER, (x, 1.0, 0.86), (0.016, 1.25, 0.016))
            for x in np.linspace(-0.55, 0.55, 8).tolist()
        ),
    ]
    return _without_door(boxes, (0.4, 3.2), -97.0)


def board_standing_free() -> HandMade:
    """Return a board of 0.9 x 1.9 m on two feet, 1.3 m before a bare wall."""
    board = Box(Part.OTHER, (0.0, 1.3, 1.0), (0.90, 0.03, 1.90))
    feet = [Box(Part.OTHER, (x, 1.3, 0.03), (0.05, 0.5, 0.06)) for x in (-0.4, 0.4)]
    return _without_door([board, *feet], (-0.6, 3.6), -80.0)


def shelves() -> HandMade:
    """Return two open shelves of 0.9 x 2.0 m at a wall, a gap of 0.8 m between them."""
    boxes = []
    for middle in (-0.85, 0.85):
        boxes += [Box(Part.OTHER, (middle + x, 0.175, 1.0), (0.02, 0.35, 2.0)) for x in (-0.44, 0.44)]
        boxes += [
            Box(Part.OTHER, (middle, 0.175, z), (0.86, 0.35, 0.02))
            for z in (0.06, 0.42, 0.81, 1.2, 1.59, 1.98)
        ]
    return _without_door(boxes, (0.7, 3.0), -105.0)


def counter() -> HandMade:
    """Return two counters 1.1 m high with a passage of 0.9 m between them, a wall 1.5 m behind."""
    boxes = []
    for middle in (-1.45, 1.45):
        boxes.append(Box(Part.OTHER, (middle, 1.8, 0.53), (2.0, 0.55, 1.06)))
        boxes.append(Box(Part.OTHER, (middle, 1.8, 1.08), (2.0, 0.65, 0.04)))
    return _without_door(boxes, (0.5, 4.2), -97.0)


def wall_with_columns() -> HandMade:
    """Return a wall with columns 0.2 m deep, 0.95 m apart, joined by a beam 2.1 m high."""
    columns = [Box(Part.WALL, (x, 0.1, 1.3), (0.30, 0.20, 2.6)) for x in (-1.875, -0.625, 0.625, 1.875)]
    beam = Box(Part.WALL, (0.0, 0.1, 2.35), (5.0, 0.20, 0.5))
    return _without_door([*columns, beam], (0.3, 2.9), -95.0)


def glass_leaf_seen_through() -> HandMade:
    """Return a closed leaf of glass through which the room behind is measured."""
    bar = Handle(kind="bar", height_m=1.0, projection_m=0.06, length_m=0.4)
    door = Door(kind="full_glass", leaf_thickness_m=0.035, handle=bar)
    return _with_door(door, 0.0, (0.2, 2.2), -94.0, far=Space(left_m=1.5, right_m=1.5, depth_m=2.0))


def dark_leaf() -> HandMade:
    """Return a closed black leaf of which nothing returns; frame and floor before it are measured."""
    return _darkened(_with_door(Door(), 0.0, (0.2, 2.2), -94.0, pitch_deg=12.0))


def glazed_dark_leaf() -> HandMade:
    """Return a closed black leaf with a pane from 0.2 m on, through which the room behind is measured."""
    door = Door(kind="glazed", pane_bottom_m=0.2, handle=LEVER)
    far = Space(left_m=1.5, right_m=1.5, depth_m=2.0)
    return _darkened(_with_door(door, 0.0, (0.2, 1.9), -94.0, height_m=1.2, pitch_deg=15.0, far=far))


def dark_leaf_seen_without_floor() -> HandMade:
    """Return a closed black leaf so near that the floor before it is below the view."""
    return _darkened(_with_door(Door(), 0.0, (0.2, 1.5), -94.0))


def open_doorway_out_of_range() -> HandMade:
    """Return an open doorway 4.8 m off, behind which everything is farther than the camera measures."""
    near, far = Space(left_m=2.5, right_m=2.5, depth_m=6.0), Space(depth_m=6.0)
    return _with_door(Door(swing="away"), 90.0, (-0.4, 4.8), -86.0, near=near, far=far)


def board_before_the_lens() -> HandMade:
    """Return a closed door behind a board of which the camera measures the farther edge only."""
    board = Box(Part.OTHER, (0.0, 1.17, 1.0), (0.3, 0.02, 2.0), yaw_rad=math.radians(60.0))
    return _with_door(Door(handle=LEVER), 0.0, (0.0, 1.5), -90.0, extra=(board,))


def window_beside_a_closed_door() -> HandMade:
    """Return a closed door beside a stretch of wall, 0.8 x 1.2 m, from which nothing comes back."""
    window = Box(Part.OTHER, (1.1, 0.01, 1.5), (0.8, 0.02, 1.2), material="dark")
    return _with_door(Door(handle=LEVER), 0.0, (0.4, 2.6), -95.0, extra=(window,))


def open_double_door_with_one_closed_leaf() -> HandMade:
    """Return a double door of which one leaf is open towards the camera."""
    door = Door(kind="double_equal", opening_width_m=1.4, active_share=0.5, handle=LEVER)
    return _with_door(door, 88.0, (0.5, 2.3), -102.0, far=Space(depth_m=4.0))


def open_leaf_at_the_near_jamb() -> HandMade:
    """Return an open leaf that hides its opening, seen along the wall."""
    return _with_door(Door(hinge="left", handle=LEVER), 90.0, (1.9, 0.75), -160.0)


def open_doorway_without_lintel() -> HandMade:
    """Return an open doorway, its lintel above the view and its leaf out of sight; the floor goes on behind it."""
    door = Door(swing="away")
    return _with_door(door, 100.0, (-0.1, 1.5), -87.0, height_m=0.9, pitch_deg=18.0, far=Space(depth_m=6.0))


WITH_DOOR: dict[str, Callable[[], HandMade]] = {
    function.__name__: function
    for function in (
        closed_door_beside_free_corridor,
        leaf_square_in_the_room,
        doorway_at_the_edge_of_a_rolled_view,
        closed_door_in_a_recess_beside_a_fridge,
        lower_leaf_from_near_the_floor,
        glass_leaf_seen_through,
        dark_leaf,
        open_doorway_without_lintel,
        window_beside_a_closed_door,
    )
}
WITHOUT_DOOR: dict[str, Callable[[], HandMade]] = {
    function.__name__: function
    for function in (table_football, board_standing_free, shelves, counter, wall_with_columns)
}


def _with_door(
    door: Door,
    angle_deg: float,
    robot_m: tuple[float, float],
    heading_deg: float,
    *,
    height_m: float = 1.0,
    pitch_deg: float = 0.0,
    roll_deg: float = 0.0,
    near: Space = ROOM,
    far: Space = Space(depth_m=3.0),  # noqa: B008 (frozen)
    extra: Sequence[Box] = (),
) -> HandMade:
    opening = Opening(angle_deg=angle_deg)
    boxes = [*scene_boxes(Scene(door=door, near=near, far=far), opening), *extra]
    pose = CameraPose.from_degrees((*robot_m, height_m), heading_deg, pitch_deg, roll_deg)
    truth = describe_door(door, opening, Pose(*robot_m, math.radians(heading_deg)), height_m)
    return HandMade(boxes, pose, (truth,))


def _darkened(made: HandMade) -> HandMade:
    """Return the scene with everything opaque of the leaf black."""
    boxes = [
        box._replace(material="dark") if box.part is Part.LEAF and box.material == "matte" else box
        for box in made.boxes
    ]
    return HandMade(boxes, made.pose, made.doors)


def _without_door(boxes: Sequence[Box], robot_m: tuple[float, float], heading_deg: float) -> HandMade:
    room = scene_boxes(Scene(feature=WALL, near=ROOM), Opening())
    return HandMade([*room, *boxes], CameraPose.from_degrees((*robot_m, 1.0), heading_deg, 0.0))
