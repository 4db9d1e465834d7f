# SPDX-License-Identifier: Apache-2.0
"""Views of one building: six doors of one style, each in a room of its own, and one camera with its own errors.

The building depends on the seed alone; the number of a view chooses door, place, openings and people. Rooms are
furnished once. As every door has its own room, no view of one of the six shows another.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from doorstate.simulation.camera import CameraBias
from doorstate.simulation.draw.building.doors import KIND_WEIGHTS, draw_building_door
from doorstate.simulation.draw.building.layout import (
    INNER_WALL_M,
    LAYOUTS,
    draw_plan,
    draw_spaces_behind,
)
from doorstate.simulation.draw.building.people import draw_people
from doorstate.simulation.draw.building.plan import Plan
from doorstate.simulation.draw.building.scene import (
    AROUND_CAMERA_M,
    USUAL_DOOR,
    drawn_scene,
    furnish,
    main_door,
    occupied,
)
from doorstate.simulation.draw.building.swing import draw_door_openings
from doorstate.simulation.draw.building.view import look
from doorstate.simulation.draw.building.viewpoint import body_box, draw_camera
from doorstate.simulation.draw.doors import WALL_HEIGHT_M
from doorstate.simulation.draw.layouts import PlacedCamera
from doorstate.simulation.draw.scenes import DrawnScene, exhausted
from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene.door import Door, Opening
from doorstate.simulation.scene.plan import Footprints, collide

DOORS = 6
OPENINGS = 12  # of each door in each state; furniture keeps clear of all of them
# Lifts have doors of another style, and stairwells are high.
_LAYOUTS = {kind: share for kind, share in LAYOUTS.items() if kind not in ("lobby", "stairwell")}
_KINDS = {kind: weight for kind, weight in KIND_WEIGHTS.items() if kind not in ("folding", "revolving")}
_HEIGHT_M, _PITCH_DEG, _ROLL_DEG = (0.3, 1.5), (-5.0, 15.0), (-1.5, 1.5)
_ROCKING_DEG = 1.0  # of a robot that drives; its camera tells it
_BIAS_DEG, _BIAS_SHARE = 2.0, 0.02
_ROOM_TRIES, _VIEW_TRIES = 400, 600
_CHECKED_VIEWS, _LEAST_VIEWS = 30, 4  # a room from which the door is hardly seen is drawn again


class _Mount(NamedTuple):
    """Camera on its robot."""

    height_m: float
    pitch_deg: float
    roll_deg: float
    bias: CameraBias


class _Room(NamedTuple):
    """Furnished room of a door, without people."""

    plan: Plan
    door: int  # number of the door in the plan; the others are only there
    openings: tuple[list[list[Opening]], ...]  # of all doors in all states
    taken: Footprints


class Site(NamedTuple):
    """A building and the camera that looks at it."""

    rooms: tuple[_Room, ...]
    mount: _Mount


class _View(NamedTuple):
    """Room with people, and the camera in it."""

    plan: Plan
    camera: PlacedCamera


@lru_cache(maxsize=4)
def draw_site(seed: int) -> Site:
    """Draw the building of a seed.

    Raises:
        ConfigError: no room fits.
    """
    stream = Stream(seed, 0, "site building")
    bias = CameraBias(
        pitch_deg=stream.uniform(-_BIAS_DEG, _BIAS_DEG),
        roll_deg=stream.uniform(-_BIAS_DEG, _BIAS_DEG),
        depth_factor=stream.uniform(1 - _BIAS_SHARE, 1 + _BIAS_SHARE),
    )
    mount = _Mount(stream.uniform(*_HEIGHT_M), stream.uniform(*_PITCH_DEG), stream.uniform(*_ROLL_DEG), bias)
    style = draw_building_door(
        stream, (stream.uniform(*INNER_WALL_M), stream.uniform(*WALL_HEIGHT_M)), _KINDS
    )
    return Site(tuple(_draw_room(stream, style, mount) for _ in range(DOORS)), mount)


def draw_site_view(seed: int, index: int) -> DrawnScene:
    """Draw a view of the building of a seed; the doors take turns."""
    site, stream = draw_site(seed), Stream(seed, index, "site")
    number = index % DOORS
    room = site.rooms[number]
    for _ in range(_VIEW_TRIES):
        view = _draw_view(stream, room, site.mount)
        if view is not None:
            openings = room.openings[stream.integer(0, OPENINGS - 1)]
            drawn = drawn_scene(stream, view.plan, view.camera, room.door, openings)
            return drawn._replace(door_id=f"site-{seed}-d{number}", bias=site.mount.bias)
    raise exhausted(_VIEW_TRIES)


def _draw_room(stream: Stream, style: Door, mount: _Mount) -> _Room:
    for _ in range(_ROOM_TRIES):
        plan = draw_plan(stream, stream.choice(_LAYOUTS), has_doors=True, style=style)
        if not plan.layout.doors:
            continue
        plan = draw_spaces_behind(stream, plan)
        groups = plan.box_groups(0)
        openings = []
        for _ in range(OPENINGS):
            drawn = draw_door_openings(stream, plan, groups)
            if drawn is None:
                break
            openings.append(drawn)
        if len(openings) < OPENINGS:
            continue
        of_doors = [
            [opening for one in openings for opening in one[door]] for door in range(len(plan.layout.doors))
        ]
        plan, taken = furnish(stream, plan, occupied(plan, groups, of_doors))
        room = _Room(plan, stream.integer(0, len(plan.layout.doors) - 1), tuple(openings), taken)
        views = (_draw_view(stream, room, mount) for _ in range(_CHECKED_VIEWS))
        if sum(view is not None for view in views) >= _LEAST_VIEWS:
            return room
    raise exhausted(_ROOM_TRIES)


def _draw_view(stream: Stream, room: _Room, mount: _Mount) -> _View | None:
    """Draw a camera and people; None if the camera does not fit, or another door is more in front."""
    target = room.plan.layout.door_frame(room.door)
    placed = draw_camera(stream, room.plan, target)
    if placed is None:
        return None
    camera = placed._replace(
        height_m=mount.height_m,
        pitch_deg=round(mount.pitch_deg + stream.uniform(-_ROCKING_DEG, _ROCKING_DEG), 4),
        roll_deg=round(mount.roll_deg + stream.uniform(-_ROCKING_DEG, _ROCKING_DEG), 4),
    )
    body = [body_box(camera)]
    if collide(body, room.taken, AROUND_CAMERA_M):
        return None
    taken = room.taken.joined(Footprints.of(body))
    people = draw_people(stream, room.plan, camera, (target.x_m, target.y_m), taken)
    plan = room.plan._replace(people=people)
    groups = plan.box_groups(0)
    main = main_door(plan, look(groups.all(), camera), groups, camera, USUAL_DOOR)
    return _View(plan, camera) if main == room.door else None
