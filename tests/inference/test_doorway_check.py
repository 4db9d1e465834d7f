# SPDX-License-Identifier: Apache-2.0
"""Tests of doorstate.inference.doorway_check on scenes made by hand, and on frames of Gazebo with parts lost."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from doorstate.clouds.measured import is_measured
from doorstate.doorways.doorway import Doorway
from doorstate.doorways.finder import FinderSettings, find_doorways
from doorstate.inference.door import Door
from doorstate.inference.gate import DEFAULT_GATE, DoorwayCheck
from doorstate.io.depth import depth_to_points
from doorstate.simulation.camera import CAMERAS
from doorstate.simulation.frames import level
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.presets import PRESETS
from doorstate.simulation.true_door import TrueDoor
from doorstate.simulation.truth import true_doors
from doorstate.types import DoorState, Part, Points
from tests.doorways import scenes
from tests.doorways.scenes import HandMade

_GAZEBO = Path(__file__).resolve().parents[1] / "fixtures" / "gazebo"
# Seen at 15 degrees to its wall: the far jamb hides two thirds of the opening, two columns of pixels pass it, and most
# of what they pass to is out of range. What is left would look the same with a black leaf at the back of the wall.
_OPEN_WITHOUT_LEAF = "02_open"


def _check(made: HandMade, state: DoorState, cloud: Points | None = None) -> DoorwayCheck:
    door = _said(made.doors[0], state, made.floor_z_m)
    return _check_door(made.points if cloud is None else cloud, door)


def _said(place: TrueDoor | Doorway, state: DoorState, floor_z_m: float) -> Door:
    """Return a door at a place that is said to have a state."""
    return Door(place.x_m, place.y_m, place.yaw_deg, place.width_m, state, floor_z_m=floor_z_m)


def _check_door(cloud: Points, door: Door) -> DoorwayCheck:
    (check,) = DEFAULT_GATE.check_doorways(cloud, [door])
    return check


def _code(check: DoorwayCheck) -> str | None:
    return None if check.abstention is None else check.abstention.code


@cache
def _frames() -> list[tuple[str, Points, Door]]:
    frames = []
    with np.load(_GAZEBO / "depth.npz") as stored:
        depths = stored["depth"]
    for scene, depth_m in zip(
        json.loads((_GAZEBO / "scenes.json").read_text(encoding="utf-8")), depths, strict=True
    ):
        camera = scene["camera"]
        cos, sin = math.cos(camera["yaw"]), math.sin(camera["yaw"])
        points = depth_to_points(depth_m, CAMERAS["xtion-gazebo"].intrinsics())
        door = Door(
            -camera["x"] * cos - camera["y"] * sin,
            camera["x"] * sin - camera["y"] * cos,
            math.degrees(-camera["yaw"]),
            0.9,
            DoorState(scene["state"]),
            floor_z_m=-camera["z"],
        )
        frames.append((scene["name"], level(points, camera["pitch"]), door))
    return frames


def _with_loss(points: Points, rng: np.random.Generator, kind: str) -> Points:
    if kind == "random":
        return np.where(rng.random(points.shape[:2])[..., None] < 0.75, np.float32(np.nan), points)
    if kind == "flat":
        return points[is_measured(points) & (rng.random(points.shape[:2]) < 0.25)]
    height, width = (round(size * math.sqrt(0.1)) for size in points.shape[:2])
    row, column = (int(rng.integers(points.shape[axis] - size)) for axis, size in enumerate((height, width)))
    lost = points.copy()
    lost[row : row + height, column : column + width] = np.nan
    return lost


@pytest.mark.parametrize("state", [DoorState.OPEN, DoorState.CLOSED, DoorState.SEMI_OPEN])
def test_a_dark_leaf_is_unknown_in_any_state(state: DoorState) -> None:
    check = _check(scenes.dark_leaf(), state)
    assert _code(check) == "door_dark"
    assert check.abstention is not None
    assert check.abstention.values["share"] > 0.7
    assert str(check.abstention)


@pytest.mark.parametrize("state", list(DoorState))
@pytest.mark.parametrize(
    ("make", "code", "value", "low", "high"),
    [
        (scenes.board_before_the_lens, "door_too_near", "range_m", 0.4, 0.5),
        (scenes.open_doorway_out_of_range, "door_out_of_range", "range_m", 4.7, 5.1),
        (scenes.dark_leaf_seen_without_floor, "door_not_measured", "share", 0.9, 1.0),
    ],
)
def test_reasons_are_apart(
    make: Callable[[], HandMade], code: str, value: str, low: float, high: float, state: DoorState
) -> None:
    check = _check(make(), state)
    assert _code(check) == code
    assert check.abstention is not None
    assert low <= float(check.abstention.values[value]) <= high
    assert str(check.abstention)


def test_a_semi_open_leaf_of_which_nothing_was_seen_is_out_of_view() -> None:
    check = _check(scenes.glass_leaf_seen_through(), DoorState.SEMI_OPEN)
    assert _code(check) == "leaf_out_of_view"
    assert str(check.abstention)


def test_a_pane_in_a_dark_leaf_is_no_open_door() -> None:
    assert _code(_check(scenes.glazed_dark_leaf(), DoorState.OPEN)) == "door_glass"


def test_a_leaf_is_seen_although_it_hides_the_opening() -> None:
    assert _check(scenes.open_leaf_at_the_near_jamb(), DoorState.OPEN) == DoorwayCheck(None, leaf_seen=True)


def test_one_open_leaf_of_a_double_door_is_enough() -> None:
    assert _code(_check(scenes.open_double_door_with_one_closed_leaf(), DoorState.OPEN)) is None


@pytest.mark.parametrize("make", scenes.WITHOUT_DOOR.values(), ids=scenes.WITHOUT_DOOR)
def test_furniture_is_no_seen_leaf(make: Callable[[], HandMade]) -> None:
    made = make()
    improbable = FinderSettings(min_score=0.0)
    found = find_doorways(made.points, made.floor_z_m, improbable)
    doors = [_said(doorway, DoorState.OPEN, made.floor_z_m) for doorway in found]
    assert doors
    assert not any(check.leaf_seen for check in DEFAULT_GATE.check_doorways(made.points, doors))


@pytest.mark.parametrize(
    ("preset", "sensor", "index", "kind"),
    [
        ("varied", "d435", 7, "glazed"),  # seen along the wall, beside which another wall stands
        ("cluttered", "d435", 29, "glazed"),  # beside a person
        ("cluttered", "d435", 13, "sliding"),
        ("cluttered", "xtion", 37, "single"),  # behind a plant
        ("cluttered", "d435", 11, "full_glass"),
    ],
)
def test_what_stands_before_dark_and_glass_leaves_is_no_seen_leaf(
    preset: str, sensor: str, index: int, kind: str
) -> None:
    rows, frames = simulate_rows(PRESETS[preset], 66002, index, sensor)
    for row, frame in zip(rows, frames, strict=True):
        (true,) = true_doors(row)
        assert true.kind == kind
        dark = frame.points.copy()
        dark[frame.cut.part == Part.LEAF] = np.nan
        assert not _check_door(dark, _said(true, DoorState.OPEN, true.floor_z_m)).leaf_seen


@pytest.mark.parametrize(
    ("preset", "sensor", "index"),
    [("varied", "d435", 26), ("varied", "d435", 28), ("cluttered", "d435", 10), ("cluttered", "d435", 23)],
)
def test_open_doors_seen_along_the_wall_are_not_blocked(preset: str, sensor: str, index: int) -> None:
    rows, frames = simulate_rows(PRESETS[preset], 66002, index, sensor)
    (opened,) = [number for number, row in enumerate(rows) if row.state == "open"]
    true = true_doors(rows[opened])[0]
    door = _said(true, DoorState.OPEN, true.floor_z_m)
    assert _code(_check_door(frames[opened].points, door)) is None


def test_a_sliding_leaf_behind_a_thick_wall_blocks_its_opening() -> None:
    rows, frames = simulate_rows(PRESETS["varied"], 66002, 46, "d435")
    (closed,) = [number for number, row in enumerate(rows) if row.state == "closed"]
    true = true_doors(rows[closed])[0]
    assert true.kind == "sliding"
    door = _said(true, DoorState.OPEN, true.floor_z_m)
    assert _code(_check_door(frames[closed].points, door)) == "opening_blocked"


def test_a_leaf_of_glass_is_never_a_seen_leaf() -> None:
    assert _check(scenes.glass_leaf_seen_through(), DoorState.OPEN) == DoorwayCheck(None, leaf_seen=False)
    assert _code(_check(scenes.glass_leaf_seen_through(), DoorState.CLOSED)) == "door_glass"


def test_a_floor_that_goes_on_behind_is_an_open_door_without_its_lintel() -> None:
    assert _code(_check(scenes.open_doorway_without_lintel(), DoorState.OPEN)) is None


@pytest.mark.parametrize(
    ("make", "state"),
    [
        (scenes.closed_door_beside_free_corridor, DoorState.CLOSED),
        (scenes.closed_door_in_a_recess_beside_a_fridge, DoorState.CLOSED),
        (scenes.doorway_at_the_edge_of_a_rolled_view, DoorState.CLOSED),
        (scenes.lower_leaf_from_near_the_floor, DoorState.SEMI_OPEN),
        (scenes.leaf_square_in_the_room, DoorState.OPEN),
        (scenes.window_beside_a_closed_door, DoorState.CLOSED),
    ],
)
def test_true_states_are_confirmed(make: Callable[[], HandMade], state: DoorState) -> None:
    assert _code(_check(make(), state)) is None


@pytest.mark.parametrize(
    "make", [scenes.closed_door_beside_free_corridor, scenes.closed_door_in_a_recess_beside_a_fridge]
)
def test_closed_doors_that_are_called_open_are_refused(make: Callable[[], HandMade]) -> None:
    assert _code(_check(make(), DoorState.OPEN)) is not None


def test_something_that_stands_before_a_door_occludes_it() -> None:
    made = scenes.glass_leaf_seen_through()
    true = made.doors[0]
    view = made.points.copy()
    across = np.abs(view[..., 1] / view[..., 0] - true.y_m / true.x_m) < 0.35
    view[across] *= np.float32(1.3) / view[across][:, :1]
    check = _check(made, DoorState.CLOSED, view)
    assert _code(check) == "door_occluded"
    assert check.abstention is not None
    assert check.abstention.values["share"] > 0.6


def test_a_door_out_of_view_is_refused() -> None:
    made = scenes.dark_leaf()
    door = _said(made.doors[0], DoorState.CLOSED, made.floor_z_m)
    assert _code(_check_door(made.points, replace(door, y_m=door.y_m + 6))) == "door_out_of_view"


@pytest.mark.parametrize("kind", ["none", "rectangle", "random", "flat"])
def test_losses_do_not_silence_measured_doors(kind: str) -> None:
    rng = np.random.default_rng(0)
    refused, unseen = [], []
    for name, points, door in _frames():
        check = _check_door(points if kind == "none" else _with_loss(points, rng, kind), door)
        refused += [name] if check.abstention is not None else []
        unseen += [name] if door.state is DoorState.OPEN and not check.leaf_seen else []
    assert set(refused) <= {_OPEN_WITHOUT_LEAF}
    assert len(unseen) <= 3


def test_closed_doors_of_gazebo_are_never_confirmed_as_open() -> None:
    for _, points, door in _frames():
        if door.state is DoorState.CLOSED:
            opened = replace(door, state=DoorState.OPEN)
            assert _code(_check_door(points, opened)) == "opening_blocked"


def test_doors_are_checked_as_if_each_were_alone() -> None:
    frames = _frames()
    _, points, door = frames[0]
    doors = [replace(door, state=state) for state in DoorState]
    doors += [replace(door, y_m=door.y_m + 6), replace(door, state=None)]
    together = DEFAULT_GATE.check_doorways(points, doors)
    assert together == [_check_door(points, door) for door in doors]
    assert len({_code(check) for check in together}) > 1


def test_a_door_without_state_or_points_is_not_checked() -> None:
    door = Door(2.0, 0.0, 90.0, 0.9, None, floor_z_m=-1.0)
    assert _check_door(np.ones((9, 3), np.float32), door) == DoorwayCheck(None)
