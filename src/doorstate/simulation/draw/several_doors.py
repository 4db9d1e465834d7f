# SPDX-License-Identifier: Apache-2.0
"""Random scenes with several doors in view: corridors, and rooms with two doors."""

from __future__ import annotations

import math
from itertools import chain, permutations

from doorstate.doorways.remoteness import remoteness_m
from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.draw.doors import WALL_HEIGHT_M, WALL_THICKNESS_M, draw_door
from doorstate.simulation.draw.layouts import Layout, PlacedCamera, WallDoor, draw_far_spaces
from doorstate.simulation.draw.openings import draw_openings
from doorstate.simulation.draw.scenes import (
    FEW_ITEMS,
    ITEM_TO_ROBOT_M,
    LEAF_TO_ROBOT_M,
    LEAST_FREE_DEG,
    DrawnScene,
    exhausted,
    solid,
    turning_deg,
    with_items,
)
from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.draw.viewpoints import Viewpoint
from doorstate.simulation.render import cut_range, render_behind_glass
from doorstate.simulation.scene.box import Box, Pose
from doorstate.simulation.scene.door import Opening
from doorstate.simulation.scene.plan import collide
from doorstate.simulation.scene.scene import Scene, box_groups, door_frames, room_boxes
from doorstate.simulation.visibility import count_visible, opening_depths_m
from doorstate.types import Part

_TRIES = 2000
_OFF_WALL_M = 0.45
_MOST_BESIDE_NORMAL_DEG = 80.0
_MOST_OFFSET_DEG = 28.0  # of the main door from the middle of the view
_REACH_M = 4.8
_LEAST_SEEN_PX = 1500  # of a door in view, in an image of 640 x 480
_SMALL = DepthCamera(width=160, height=120)
_PIXELS_PER_SMALL_PIXEL = 16
_WALL_HALF_LENGTH_M = 8.0  # as long as the floor
_DOOR_TRIES = 20


def draw_corridor(stream: Stream) -> DrawnScene:
    """Draw a corridor with two to four doors in its side walls, and sometimes one in its end, seen along it."""
    count = stream.choice({2: 0.35, 3: 0.35, 4: 0.30})
    for _ in range(_TRIES):
        width = stream.uniform(1.3, 3.0)
        behind, ahead = stream.uniform(0.7, 2.0), stream.uniform(2.5, 7.0)
        has_wall = (True, stream.chance(0.6), True, stream.chance(0.5))
        layout = Layout(round(behind + ahead, 4), width, has_wall)
        walls_m = _draw_walls(stream)
        for number in range(count):
            # The first two doors stand on different sides.
            wall = 2 * number if number < 2 else 2 * stream.integer(0, 1)
            layout = _with_door(stream, layout, wall, walls_m[wall], (behind + 0.6, behind + _REACH_M))
        if has_wall[1] and ahead <= _REACH_M and stream.chance(0.4):
            layout = _with_door(stream, layout, 1, walls_m[1], (0.0, width))
        heading = math.radians(stream.uniform(-45, 45))
        pose = Pose(behind, stream.uniform(_OFF_WALL_M, width - _OFF_WALL_M), heading)
        if len(layout.doors) >= count:
            drawn = _draw_view(stream, layout, _draw_camera(stream, pose))
            if drawn:
                return drawn
    raise exhausted(_TRIES)


def draw_two_doors(stream: Stream) -> DrawnScene:
    """Draw a room with two doors in view: in one wall (40 %), in walls that meet (35 %) or face each other (25 %)."""
    walls = stream.choice({(0, 0): 0.40, (0, 1): 0.35, (0, 2): 0.25})
    for _ in range(_TRIES):
        # Two walls that face each other are in view from the end of a long room.
        facing = walls == (0, 2)
        length, width = (
            stream.uniform(4.5 if facing else 2.2, 6.0),
            stream.uniform(2.2, 3.5 if facing else 6.0),
        )
        has_wall = tuple(wall in walls or stream.chance(0.85) for wall in range(4))
        layout = Layout(length, width, (has_wall[0], has_wall[1], has_wall[2], has_wall[3]))
        walls_m = _draw_walls(stream)
        for wall in walls:
            layout = _with_door(stream, layout, wall, walls_m[wall], (0.0, layout.wall_length_m(wall)))
        if len(layout.doors) < 2:
            continue
        x, y = (stream.uniform(_OFF_WALL_M, side - _OFF_WALL_M) for side in (length, width))
        first, second = (
            math.atan2(frame.y_m - y, frame.x_m - x) for frame in map(layout.door_frame, range(2))
        )
        apart = math.remainder(second - first, 2 * math.pi)
        heading = first + apart / 2 + math.radians(stream.uniform(-12, 12))
        if abs(apart) < math.radians(55):
            drawn = _draw_view(stream, layout, _draw_camera(stream, Pose(x, y, heading)))
            if drawn:
                return drawn
    raise exhausted(_TRIES)


def _draw_walls(stream: Stream) -> list[tuple[float, float]]:
    """Draw the thickness of each wall and the height of all."""
    height = stream.uniform(*WALL_HEIGHT_M)
    return [(stream.uniform(*WALL_THICKNESS_M), height) for _ in range(4)]


def _with_door(
    stream: Stream, layout: Layout, wall: int, wall_m: tuple[float, float], along_m: tuple[float, float]
) -> Layout:
    """Return the layout with one more door in a wall, or without it if it does not fit."""
    door = draw_door(stream, wall_m).model_copy(update={"wall_half_length_m": _WALL_HALF_LENGTH_M})
    for _ in range(_DOOR_TRIES):
        along = stream.uniform(*along_m)
        # Walls are numbered around the room, so that the third runs against x.
        candidate = WallDoor(wall, round(layout.length_m - along, 4) if wall == 2 else along, door)
        if layout.fits(candidate):
            return layout._replace(doors=(*layout.doors, candidate))
    return layout


def _draw_camera(stream: Stream, pose: Pose) -> PlacedCamera:
    return PlacedCamera(pose, stream.uniform(0.25, 1.8), stream.uniform(-10, 10), stream.uniform(-2, 2))


def _draw_view(stream: Stream, layout: Layout, camera: PlacedCamera) -> DrawnScene | None:
    """Choose the main door, and draw openings and clutter.

    Returns:
        None if fewer than two doors are in view, a leaf cannot turn, or something collides.
    """
    layout = draw_far_spaces(stream, layout)
    main = _most_in_front(layout, camera)
    if main is None:
        return None
    scene, viewpoint = layout.scene(main), camera.viewpoint(layout.door_frame(main))
    if abs(viewpoint.heading_offset_deg) > _MOST_OFFSET_DEG:
        return None
    openings = _draw_all_openings(stream, scene)
    if openings is None:
        return None
    walls = solid(room_boxes(scene))
    moving: list[Box] = []
    for own, others in openings:
        groups = box_groups(scene, own, others)
        doors = [groups.main, *groups.other_doors]
        if any(
            collide(boxes, list(chain.from_iterable(doors[:number]))) for number, boxes in enumerate(doors)
        ):
            return None
        moving += chain.from_iterable(doors)
    leaves = [box for box in moving if box.part is Part.LEAF]
    if collide([viewpoint.robot_box(LEAF_TO_ROBOT_M)], leaves) or collide([viewpoint.robot_box()], walls):
        return None
    if stream.chance(0.5):
        obstacles = [*moving, *walls, viewpoint.robot_box(ITEM_TO_ROBOT_M)]
        scene = with_items(stream, scene, viewpoint, FEW_ITEMS, obstacles)
        main_in_view, *others_in_view = _are_in_view(scene, viewpoint)
        if not (main_in_view and any(others_in_view)):
            return None
    mains, others_of = zip(*openings, strict=True)
    return DrawnScene(scene, viewpoint, list(mains), other_openings=others_of)


def _most_in_front(layout: Layout, camera: PlacedCamera) -> int | None:
    """Return the number of the door most in front of those in view; None if fewer than two are in view."""
    remoteness = {}
    in_view = _are_in_view(layout.scene(0), camera.viewpoint(layout.door_frame(0)))
    for number, is_in_view in enumerate(in_view):
        if is_in_view:
            ahead = camera.pose.inverse().after(layout.door_frame(number))
            remoteness[number] = remoteness_m(ahead.x_m, ahead.y_m)
    return min(remoteness, key=remoteness.__getitem__) if len(remoteness) >= 2 else None


def _are_in_view(scene: Scene, viewpoint: Viewpoint) -> list[bool]:
    """Return, for each door of a scene, True if it is in view while all are closed.

    Leaf and frame fill at least 1500 of 640 x 480 pixels, and the camera is at most 80 degrees beside the normal.
    """
    pose, intrinsics = viewpoint.camera_pose(), _SMALL.intrinsics()
    groups = box_groups(scene, Opening(), [Opening()] * len(scene.other_doors or ()))
    full = render_behind_glass(groups.all(), pose, intrinsics)
    cut = cut_range(full, _SMALL)
    in_view = []
    for numbers, frame, opening_m in zip(
        groups.doors(), door_frames(scene), opening_depths_m(scene, pose, intrinsics), strict=True
    ):
        px = count_visible(full, cut, numbers, opening_m)
        seen = pose.seen_from(frame)
        beside_deg = math.degrees(abs(math.atan2(seen.x_m, seen.y_m)))
        in_view.append(
            (px.leaf + px.frame) * _PIXELS_PER_SMALL_PIXEL >= _LEAST_SEEN_PX
            and beside_deg <= _MOST_BESIDE_NORMAL_DEG
        )
    return in_view


def _draw_all_openings(stream: Stream, scene: Scene) -> list[tuple[Opening, tuple[Opening, ...]]] | None:
    """Draw openings of all doors for three samples, each door in each state once; None if a leaf cannot turn."""
    assert scene.door is not None
    others = scene.other_doors or ()
    frames = door_frames(scene)
    closed = box_groups(scene, Opening(), [Opening()] * len(others))
    fixed = [closed.main, *closed.other_doors]
    drawn = []
    for number, door in enumerate((scene.door, *(placed.door for placed in others))):
        around = [*solid(closed.room), *chain.from_iterable(fixed[:number] + fixed[number + 1 :])]
        free_deg = turning_deg(door, frames[number].inverse().place(around))
        if free_deg < LEAST_FREE_DEG:
            return None
        openings = draw_openings(stream, door, free_deg)
        order = stream.choice(dict.fromkeys(permutations(range(3)), 1.0)) if number else range(3)
        drawn.append([openings[position] for position in order])
    return [(own, tuple(rest)) for own, *rest in zip(*drawn, strict=True)]
