# SPDX-License-Identifier: Apache-2.0
"""Random scenes of buildings with doors in view, and the same rooms without a door."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import permutations

from doorstate.doorways.remoteness import remoteness_m
from doorstate.simulation.draw.building.apertures import draw_niche, draw_passage, draw_windows
from doorstate.simulation.draw.building.furniture import draw_furniture
from doorstate.simulation.draw.building.layout import draw_plan, draw_spaces_behind
from doorstate.simulation.draw.building.people import draw_people
from doorstate.simulation.draw.building.plan import Place, Plan, closed_door_boxes
from doorstate.simulation.draw.building.swing import draw_door_openings, swept_boxes
from doorstate.simulation.draw.building.view import View, look
from doorstate.simulation.draw.building.viewpoint import body_box, draw_camera
from doorstate.simulation.draw.building.walls import clear_of, draw_fixture, draw_wall_fixtures
from doorstate.simulation.draw.layouts import PlacedCamera
from doorstate.simulation.draw.scenes import DrawnScene, exhausted, solid
from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene.aperture import APERTURES, ApertureKind
from doorstate.simulation.scene.box import Box
from doorstate.simulation.scene.door import Opening
from doorstate.simulation.scene.fixture import FixtureKind, fixture_boxes
from doorstate.simulation.scene.plan import collide
from doorstate.simulation.scene.scene import BoxGroups

_TRIES, _CAMERA_TRIES = 200, 5
RANGE_M = (0.4, 5.0)
LEAST_MEASURED = 0.4  # of the rays, within the range
LEAST_DOOR_RAYS = 5  # of 432: about 3500 pixels of 640 x 480
_MOST_BESIDE_NORMAL_DEG = 88.0

SUBJECTS: dict[FixtureKind | ApertureKind | None, float] = {
    None: 0.16,  # a wall
    "niche": 0.12,
    "passage": 0.12,
    "cupboard": 0.12,
    "window": 0.1,
    "board": 0.1,
    "shelves": 0.08,
    "counter": 0.06,
    "column": 0.06,
    "panels": 0.08,
}


def draw_building(stream: Stream) -> DrawnScene:
    """Draw a room of a building with at least one door in view."""
    for _ in range(_TRIES):
        plan = draw_plan(stream, has_doors=True)
        if plan.layout.doors:
            drawn = _draw_with_doors(stream, draw_spaces_behind(stream, plan))
            if drawn:
                return drawn
    raise exhausted(_TRIES)


def draw_building_no_door(stream: Stream) -> DrawnScene:
    """Draw a room of a building without a door; the camera looks at a wall or at something else than a door."""
    shows = stream.choice(SUBJECTS)
    for _ in range(_TRIES):
        drawn = _draw_without_door(stream, draw_plan(stream, has_doors=False), shows)
        if drawn:
            return drawn
    raise exhausted(_TRIES)


def _draw_with_doors(stream: Stream, plan: Plan) -> DrawnScene | None:
    groups = plan.box_groups(0)
    openings = draw_door_openings(stream, plan, groups)
    if openings is None:
        return None
    swept = swept_boxes(plan, openings)
    walls = [*solid(groups.room), *(box for boxes in closed_door_boxes(groups) for box in boxes)]
    target = stream.integer(0, len(plan.layout.doors) - 1)
    for _ in range(_CAMERA_TRIES):
        frame = plan.layout.door_frame(target)
        camera = draw_camera(stream, plan, frame)
        if camera is None or collide([body_box(camera)], [*walls, *swept], -0.05):
            continue
        # A first look at the bare room saves furnishing it in vain.
        if _main_door(plan, groups, camera) is None:
            continue
        furnished = _furnish(stream, plan, camera, (frame.x_m, frame.y_m), [*walls, *swept])
        if (main := _main_door(furnished, furnished.box_groups(0), camera)) is not None:
            return _drawn(furnished, camera, main, openings)
    return None


def _furnish(
    stream: Stream, plan: Plan, camera: PlacedCamera, target_m: tuple[float, float], obstacles: list[Box]
) -> Plan:
    """Return the plan with fixtures, furniture and people that keep clear of obstacles and the camera."""
    taken = [*obstacles, body_box(camera), *(flight.outline() for flight in plan.stairs)]
    fixtures = (*plan.fixtures, *draw_wall_fixtures(stream, plan, taken))
    taken += [box for fixture in fixtures for box in fixture_boxes(fixture)]
    plan = plan._replace(fixtures=fixtures, items=draw_furniture(stream, plan, taken))
    taken += plan.scene(Place(0, 0.0)).items and _item_boxes(plan)
    return plan._replace(people=draw_people(stream, plan, camera, target_m, taken))


def _main_door(plan: Plan, groups: BoxGroups, camera: PlacedCamera) -> int | None:
    """Return the number of the door most in front of those in view; None if none is, or the view is too empty."""
    view = look(groups.all(), camera)
    if view.share_between(*RANGE_M) < LEAST_MEASURED:
        return None
    remoteness = {}
    for number, numbers in enumerate(groups.doors()):
        if number == 0:
            wall_boxes = sum(box.part == groups.main[0].part for box in groups.main)
            numbers = numbers[wall_boxes:]
        seen = plan.layout.door_frame(number).inverse().after(camera.pose)
        beside_deg = math.degrees(math.atan2(abs(seen.x_m), seen.y_m))
        if view.rays_on(numbers, RANGE_M[1]) >= LEAST_DOOR_RAYS and beside_deg <= _MOST_BESIDE_NORMAL_DEG:
            ahead = camera.pose.inverse().after(plan.layout.door_frame(number))
            remoteness[number] = remoteness_m(ahead.x_m, ahead.y_m)
    return min(remoteness, key=remoteness.__getitem__) if remoteness else None
