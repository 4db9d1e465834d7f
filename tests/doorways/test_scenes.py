# SPDX-License-Identifier: Apache-2.0
"""Scenes made by hand: they show what their names say, and every door is among the candidates of the finder."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from doorstate.clouds.measured import is_measured
from doorstate.doorways.finder import find_doorways
from doorstate.types import Part
from tests.doorways import scenes
from tests.doorways.scenes import HandMade
from tests.simulation.door_frame import to_door_frame


@pytest.mark.parametrize("make", scenes.WITH_DOOR.values(), ids=scenes.WITH_DOOR)
def test_every_door_is_among_the_candidates(make: Callable[[], HandMade]) -> None:
    scene = make()
    (door,) = scene.doors
    candidates = find_doorways(scene.points, scene.floor_z_m)
    assert any(
        math.hypot(found.x_m - door.x_m, found.y_m - door.y_m) <= 0.35
        and abs(math.remainder(found.yaw_deg - door.yaw_deg, 360)) <= 20
        for found in candidates
    )


@pytest.mark.parametrize("make", scenes.WITH_DOOR.values(), ids=scenes.WITH_DOOR)
def test_frames_are_measured_where_the_truth_has_the_door(make: Callable[[], HandMade]) -> None:
    scene = make()
    (door,) = scene.doors
    frame = to_door_frame(scene.points[scene.view.part == Part.FRAME], door)
    assert len(frame) >= 1500
    assert np.abs(frame[:, 0]).max() < door.width_m / 2 + 0.1
    assert np.abs(frame[:, 1] + 0.075).max() < 0.1


@pytest.mark.parametrize("make", scenes.WITHOUT_DOOR.values(), ids=scenes.WITHOUT_DOOR)
def test_scenes_without_a_door_show_something_else(make: Callable[[], HandMade]) -> None:
    scene = make()
    assert scene.doors == ()
    assert not np.isin(scene.view.part, (Part.LEAF, Part.FRAME)).any()
    assert is_measured(scene.points).mean() > 0.8


def test_a_robot_near_the_floor_sees_the_lower_leaf_only() -> None:
    scene = scenes.lower_leaf_from_near_the_floor()
    leaf = scene.points[scene.view.part == Part.LEAF]
    assert len(leaf) > 20_000
    assert leaf[:, 2].max() - scene.floor_z_m < 1.1


def test_the_lintel_is_out_of_view_and_the_floor_goes_on() -> None:
    scene = scenes.open_doorway_without_lintel()
    points = to_door_frame(scene.points, scene.doors[0])
    assert np.nanmax(points[..., 2][scene.view.part == Part.FRAME]) < 1.6
    floor = points[scene.view.part == Part.FLOOR]
    assert (floor[:, 1] < -0.5).sum() > 20_000
    assert not (scene.view.part[np.abs(points[..., 0]) < 0.3] == Part.LEAF).any()


def test_dark_leaves_return_nothing_and_glass_shows_the_room_behind() -> None:
    dark, glass = scenes.dark_leaf(), scenes.glass_leaf_seen_through()
    assert not (dark.view.part == Part.LEAF).any()
    before = to_door_frame(dark.points[dark.view.part == Part.FLOOR], dark.doors[0])
    assert (np.abs(before[:, 0]) < 0.4).sum() > 5000
    assert before[:, 1].min() > -0.2
    behind = to_door_frame(glass.points[glass.view.part == Part.WALL], glass.doors[0])
    assert (behind[:, 1] < -1.5).sum() > 20_000
    assert glass.doors[0].state == "closed"
