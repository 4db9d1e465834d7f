# SPDX-License-Identifier: Apache-2.0
"""Random scenes of buildings with doors in view, and the same rooms without a door."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import permutations
from typing import NamedTuple

from doorstate.doorways.remoteness import remoteness_m
from doorstate.simulation.draw.building.apertures import draw_niche, draw_passage, draw_windows
from doorstate.simulation.draw.building.furniture import draw_furniture
from doorstate.simulation.draw.building.layout import LAYOUTS, draw_plan, draw_spaces_behind
from doorstate.simulation.draw.building.people import draw_people
from doorstate.simulation.draw.building.plan import Place, Plan, WallAperture, closed_door_boxes
from doorstate.simulation.draw.building.swing import draw_door_openings, swept_boxes
from doorstate.simulation.draw.building.view import COARSE, View, look, shows_rectangle
from doorstate.simulation.draw.building.viewpoint import DISTANCE_M, body_box, draw_camera
from doorstate.simulation.draw.building.walls import clear_of, draw_fixture, draw_wall_fixtures
from doorstate.simulation.draw.layouts import PlacedCamera
from doorstate.simulation.draw.scenes import DrawnScene, exhausted, solid
from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene.aperture import ApertureKind
from doorstate.simulation.scene.clutter import item_boxes
from doorstate.simulation.scene.door import Opening
from doorstate.simulation.scene.fixture import FixtureKind, fixture_boxes
from doorstate.simulation.scene.plan import Footprints, collide
from doorstate.simulation.scene.scene import BoxGroups
from doorstate.types import Part

_TRIES, _CAMERA_TRIES = 200, 5
AROUND_CAMERA_M = -0.05  # a tolerance below zero is a distance
RANGE_M = (0.4, 5.0)
LEAST_MEASURED = 0.4  # of the rays, within the range
LEAST_DOOR, USUAL_DOOR = 0.012, 0.05  # shares of the rays that a door in view needs
_USUAL_CHANCE = 0.6  # of the second
LEAST_SHOWN = 0.4  # of the outline of what a view without a door is about
_MOST_BESIDE_NORMAL_DEG = 88.0
_MOST_OFFSET_RAD = math.radians(60.0)  # of the middle of the main door from the view's axis

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
    kind = stream.choice(LAYOUTS)
    for _ in range(_TRIES):
        plan = draw_plan(stream, kind, has_doors=True)
        if plan.layout.doors:
            drawn = _draw_with_doors(stream, draw_spaces_behind(stream, plan))
            if drawn:
                return drawn
    raise exhausted(_TRIES)


def draw_building_no_door(stream: Stream) -> DrawnScene:
    """Draw a room of a building without a door; the camera looks at a wall or at something else than a door."""
    kind, shows = stream.choice(LAYOUTS), stream.choice(SUBJECTS)
    for _ in range(_TRIES):
        drawn = _draw_without_door(stream, draw_plan(stream, kind, has_doors=False), shows)
        if drawn:
            return drawn
    raise exhausted(_TRIES)


def _draw_with_doors(stream: Stream, plan: Plan) -> DrawnScene | None:
    groups = plan.box_groups(0)
    openings = draw_door_openings(stream, plan, groups)
    if openings is None:
        return None
    taken = occupied(plan, groups, openings)
    target = stream.integer(0, len(plan.layout.doors) - 1)
    least = USUAL_DOOR if stream.chance(_USUAL_CHANCE) else LEAST_DOOR
    for _ in range(_CAMERA_TRIES):
        frame = plan.layout.door_frame(target)
        camera = draw_camera(stream, plan, frame)
        if camera is None or collide([body_box(camera)], taken, AROUND_CAMERA_M):
            continue
        # A first look at the bare room saves furnishing it in vain.
        if main_door(plan, look(groups.all(), camera, COARSE), groups, camera, least) is None:
            continue
        furnished = _furnish(stream, plan, camera, (frame.x_m, frame.y_m), taken)
        groups_then = furnished.box_groups(0)
        main = main_door(furnished, look(groups_then.all(), camera), groups_then, camera, least)
        if main is not None:
            return drawn_scene(stream, furnished, camera, main, openings)
    return None


def _furnish(
    stream: Stream, plan: Plan, camera: PlacedCamera, target_m: tuple[float, float], obstacles: Footprints
) -> Plan:
    """Return the plan with fixtures, furniture and people that keep clear of obstacles and the camera."""
    plan, taken = furnish(stream, plan, obstacles.joined(Footprints.of([body_box(camera)])))
    return plan._replace(people=draw_people(stream, plan, camera, target_m, taken))


def furnish(stream: Stream, plan: Plan, taken: Footprints) -> tuple[Plan, Footprints]:
    """Return the plan with fixtures and furniture that keep clear of what is taken, and what is taken then."""
    fixtures = (*plan.fixtures, *draw_wall_fixtures(stream, plan, taken))
    taken = taken.joined(Footprints.of([box for fixture in fixtures for box in fixture_boxes(fixture)]))
    plan = plan._replace(fixtures=fixtures, items=draw_furniture(stream, plan, taken))
    return plan, taken.joined(Footprints.of([box for item in plan.items for box in item_boxes(item)]))


def occupied(plan: Plan, groups: BoxGroups, openings: Sequence[Sequence[Opening]]) -> Footprints:
    """Return what furniture, people and cameras keep clear of: walls, doors, the sweep of their leaves, and stairs."""
    walls = [*solid(groups.room), *(box for boxes in closed_door_boxes(groups) for box in boxes)]
    return Footprints.of(
        [*walls, *swept_boxes(plan, openings), *(flight.outline() for flight in plan.stairs)]
    )


def main_door(
    plan: Plan, view: View, groups: BoxGroups, camera: PlacedCamera, least_share: float
) -> int | None:
    """Return the number of the door most in front of those in view; None if none is, or the view is too empty."""
    if view.share_between(*RANGE_M) < LEAST_MEASURED:
        return None
    boxes = groups.all()
    remoteness = {}
    for number, own in enumerate(groups.doors()):
        numbers = [index for index in own if boxes[index].part in (Part.LEAF, Part.FRAME)]
        seen = plan.layout.door_frame(number).inverse().after(camera.pose)
        # A door that is nearer than any target is not one that a robot still looks at.
        if math.hypot(seen.x_m, seen.y_m) < DISTANCE_M[0]:
            continue
        beside_deg = math.degrees(math.atan2(abs(seen.x_m), seen.y_m))
        if view.share_on(numbers, RANGE_M[1]) >= least_share and beside_deg <= _MOST_BESIDE_NORMAL_DEG:
            ahead = camera.pose.inverse().after(plan.layout.door_frame(number))
            if abs(math.atan2(ahead.y_m, ahead.x_m)) > _MOST_OFFSET_RAD:
                continue
            remoteness[number] = remoteness_m(ahead.x_m, ahead.y_m)
    return min(remoteness, key=remoteness.__getitem__) if remoteness else None


def drawn_scene(
    stream: Stream, plan: Plan, camera: PlacedCamera, main: int, openings: Sequence[Sequence[Opening]]
) -> DrawnScene:
    """Return the scene in the frame of its main door, whose openings come in the order of their states."""
    columns = [list(openings[main])]
    for number, own in enumerate(openings):
        if number != main:
            order = stream.choice(dict.fromkeys(permutations(range(3)), 1.0))
            columns.append([own[position] for position in order])
    rows = list(zip(*columns, strict=True))
    return DrawnScene(
        plan.scene(main),
        camera.viewpoint(plan.layout.door_frame(main)),
        [row[0] for row in rows],
        other_openings=[row[1:] for row in rows],
    )


class _Subject(NamedTuple):
    """Subject of a view without a door: a plan that contains it, its place, and its outline on the wall."""

    plan: Plan
    place: Place
    width_m: float
    heights_m: tuple[float, float]


def _draw_without_door(
    stream: Stream, plan: Plan, shows: FixtureKind | ApertureKind | None
) -> DrawnScene | None:
    walls = [number for number in range(4) if plan.layout.has_wall[number]]
    subject = _draw_subject(stream, plan, stream.choice(dict.fromkeys(walls, 1.0)), shows)
    if subject is None:
        return None
    plan, place, width_m, heights_m = subject
    groups, frame = plan.box_groups(place), plan.on_wall(*place)
    outlines = [flight.outline() for flight in plan.stairs]
    obstacles = Footprints.of([*solid(groups.room), *groups.main, *outlines])
    for _ in range(_CAMERA_TRIES):
        camera = draw_camera(stream, plan, frame)
        if camera is None or collide([body_box(camera)], obstacles, AROUND_CAMERA_M):
            continue
        if shows_rectangle(camera, frame, width_m, heights_m) < LEAST_SHOWN:
            continue
        furnished = _furnish(stream, plan, camera, (frame.x_m, frame.y_m), obstacles)
        view = look(furnished.box_groups(place).all(), camera)
        if view.share_between(*RANGE_M) >= LEAST_MEASURED:
            return DrawnScene(furnished.scene(place, shows), camera.viewpoint(frame), [Opening()])
    return None


def _draw_subject(
    stream: Stream, plan: Plan, wall: int, shows: FixtureKind | ApertureKind | None
) -> _Subject | None:
    """Draw what the view is about into a wall; None if it does not fit there."""
    if shows is None:
        along = stream.uniform(0.3, plan.layout.wall_length_m(wall) - 0.3)
        blocked = any(abs(one.along_m - along) < one.half_m for one in plan.openings(wall))
        return None if blocked else _Subject(plan, Place(wall, along), 1.0, (0.3, 2.0))
    if shows == "window" or shows == "niche" or shows == "passage":
        placed = [] if plan.openings(wall) else _draw_apertures(stream, plan, wall, shows)
        if not placed:
            return None
        shown = placed[stream.integer(0, len(placed) - 1)]
        plan, hole = plan._replace(apertures=(*plan.apertures, *placed)), shown.aperture
        return _Subject(plan, Place(wall, shown.along_m), hole.width_m, (hole.bottom_m, hole.top_m))
    low, high = stream.choice(dict.fromkeys(plan.free_stretches(wall), 1.0))
    if high - low < 0.5:
        return None
    along = stream.uniform(low, high)
    most = 2 * min(along - low, high - along) - 0.04
    fixture = draw_fixture(stream, plan, shows, wall, along, most)
    if fixture is None or not clear_of(
        [fixture], Footprints.of([flight.outline() for flight in plan.stairs])
    ):
        return None
    plan, heights_m = plan._replace(fixtures=(fixture,)), (fixture.bottom_m, min(fixture.top_m, 2.2))
    return _Subject(plan, Place(wall, along), fixture.width_m, heights_m)


def _draw_apertures(stream: Stream, plan: Plan, wall: int, kind: str) -> list[WallAperture]:
    if kind == "window":
        return draw_windows(stream, plan, wall)
    if kind == "niche":
        aperture = draw_niche(stream, plan, wall)
    else:
        aperture = draw_passage(stream, plan, wall, full_height=stream.chance(0.3))
    return [aperture] if aperture else []
