# SPDX-License-Identifier: Apache-2.0
"""Scenes of buildings: replayable, in range, with a door in view or with none, and nothing inside of another thing."""

from __future__ import annotations

from collections import Counter
from typing import get_args

import numpy as np
import pytest

from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.draw.building.layout import LAYOUTS
from doorstate.simulation.draw.building.scene import LEAST_MEASURED, SUBJECTS
from doorstate.simulation.draw.building.viewpoint import DISTANCE_M, HEIGHT_M, PITCH_DEG, ROLL_DEG
from doorstate.simulation.frames import depth_sha256, replay
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.manifest import flatten, unflatten
from doorstate.simulation.presets import PRESETS, Preset, PresetName, draw_rows
from doorstate.simulation.row import Row
from doorstate.simulation.scene import Box
from doorstate.simulation.scene.aperture import APERTURES
from doorstate.simulation.scene.clearance import keep_out_boxes
from doorstate.simulation.scene.fixture import FIXTURES
from doorstate.simulation.scene.plan import collide
from doorstate.simulation.scene.scene import LayoutKind, clutter_boxes, door_frames
from doorstate.simulation.truth import true_doors
from doorstate.types import NO_DOOR, STATES, Part

NAMES: tuple[PresetName, ...] = ("building", "building-no-door")
DRAWN = {name: [draw_rows(PRESETS[name], 0, index) for index in range(120)] for name in NAMES}
ALL = [rows[0] for name in NAMES for rows in DRAWN[name]]
CAMERA = DepthCamera(width=160, height=120)


def test_every_layout_and_every_thing_appears() -> None:
    assert {row.scene.layout for row in ALL} == set(LAYOUTS) == set(get_args(LayoutKind))
    scenes = [row.scene for row in ALL]
    assert {one.kind for scene in scenes for one in scene.fixtures or ()} == set(FIXTURES)
    assert {one.kind for scene in scenes for one in scene.apertures or ()} == set(APERTURES)
    assert any(one.sash_deg for scene in scenes for one in scene.apertures or ())
    items = {item.kind for scene in scenes for item in scene.items}
    assert items == {"chair", "table", "cabinet", "bin", "plant", "carton"}
    assert {stairs.rise_m > 0 for scene in scenes for stairs in scene.stairs or ()} == {True, False}
    assert any(scene.people for scene in scenes)
    spaces = [
        space
        for scene in scenes
        if scene.door
        for space in (scene.far, *(one.far for one in scene.other_doors or ()))
    ]
    assert 0 < sum(bool(space.is_outdoors) for space in spaces) < len(spaces) / 3


def test_views_without_a_door_are_about_every_subject() -> None:
    rows = [rows[0] for rows in DRAWN["building-no-door"]]
    assert {row.state for row in rows} == {NO_DOOR}
    assert {row.scene_kind for row in rows} == {kind or "wall" for kind in SUBJECTS}
    for row in rows:
        assert not {Part.LEAF, Part.FRAME} & {box.part for box in row.boxes()}


def test_cameras_are_spread_over_their_ranges() -> None:
    for values, ends in (
        ([row.camera_height_m for row in ALL], HEIGHT_M),
        ([row.pitch_deg for row in ALL], PITCH_DEG),
        ([row.roll_deg for row in ALL], ROLL_DEG),
    ):
        low, high = ends
        tenth = 0.1 * (high - low)
        assert low <= min(values) < low + tenth
        assert high - tenth < max(values) <= high
    doors = [door for rows in DRAWN["building"] for door in true_doors(rows[0])[:1]]
    assert min(np.hypot(door.x_m, door.y_m) for door in doors) < 1.0
    assert max(np.hypot(door.x_m, door.y_m) for door in doors) > 3.5
    beside = [abs(90 - row.robot_angle_deg) for row in (rows[0] for rows in DRAWN["building"])]
    assert max(beside) > 75
    assert min(beside) < 10
    assert DISTANCE_M == (0.6, 6.0)


def test_every_door_has_every_state_once() -> None:
    counts: Counter[int] = Counter()
    for rows in DRAWN["building"]:
        doors = [true_doors(row) for row in rows]
        counts[len(doors[0])] += 1
        for states in zip(*doors, strict=True):
            names = sorted({door.state for door in states})
            assert names == sorted(STATES) or names == ["unknown"]
            assert not any(door.ambiguous for door in states)
    assert {1, 2, 3, 4} <= set(counts)


def test_leaves_in_pockets_stay_inside_of_their_wall() -> None:
    found = 0
    for scene in (rows[0].scene for rows in DRAWN["building"]):
        for placed in scene.other_doors or ():
            door = placed.door
            if door.is_sliding and door.leaf_recess_m >= 0:
                found += 1
                assert door.leaf_recess_m + door.leaf_thickness_m <= door.wall_thickness_m + 1e-9
    assert found > 3


def swept(row: Row) -> list[Box]:
    """Return what nothing may stand in: the leaves of all doors at the openings of a row."""
    scene = row.scene
    assert scene.door is not None
    doors = [scene.door, *(placed.door for placed in scene.other_doors or ())]
    openings = [row.opening(), *(other.opening for other in row.other_doors)]
    return [
        box
        for door, frame, opening in zip(doors, door_frames(scene), openings, strict=True)
        for box in frame.place(keep_out_boxes(door, [opening]))
        # Leaves in pockets slide inside of their wall.
        if box.part is Part.LEAF and not (door.is_sliding and door.leaf_recess_m >= 0)
    ]


def test_leaves_pass_through_nothing() -> None:
    for rows in DRAWN["building"]:
        for row in rows:
            groups = row.box_groups()
            fixed = [box for box in groups.room if box.part not in (Part.FLOOR, Part.CEILING)]
            assert not collide(swept(row), [*fixed, *groups.clutter]), row.sample_id


def test_nothing_stands_in_another_thing() -> None:
    for row in ALL:
        groups = row.box_groups()
        # Chairs may be pushed under their table, and people have limbs of their own.
        bare = row.scene.without_clutter()
        fixed = [
            box
            for box in row.model_copy(update={"scene": bare}).boxes()
            if box.part not in (Part.FLOOR, Part.CEILING)
        ]
        assert not collide(groups.clutter, fixed), row.sample_id


def test_no_camera_is_inside_or_close_to_a_box() -> None:
    for rows in (rows for name in NAMES for rows in DRAWN[name]):
        for row in rows:
            at = (row.x_m, row.y_m, row.camera_height_m)
            body = Box(Part.OTHER, at, (0.3, 0.3, 0.1), np.radians(row.heading_deg))
            assert not collide([body], row.boxes(), 0.0), row.sample_id


def test_no_camera_stands_on_stairs_or_over_their_hole() -> None:
    rows = [row for row in ALL if row.scene.stairs]
    assert len(rows) > 10
    for row in rows:
        foot = Box(Part.OTHER, (row.x_m, row.y_m, 0.1), (0.2, 0.2, 0.2))
        assert not collide([foot], [stairs.outline() for stairs in row.scene.stairs or ()], 0.0)


@pytest.mark.parametrize("name", NAMES)
def test_frames_show_enough(name: PresetName) -> None:
    for index in range(0, 40, 2):
        rows, frames = simulate_rows(Preset(name=name, camera=CAMERA), 0, index)
        assert rows[0].measured_px > (LEAST_MEASURED - 0.06) * frames[0].cut.part.size
        if name == "building":
            closed = rows[0].visible_leaf_px + rows[0].visible_frame_px
            assert closed + rows[0].visible_opening_px > 0.005 * frames[0].cut.part.size


@pytest.mark.parametrize("name", NAMES)
def test_rows_read_back_and_render_again(name: PresetName) -> None:
    for index in (2, 3, 5):
        for row in simulate_rows(Preset(name=name, camera=CAMERA), 1, index)[0]:
            again = unflatten(flatten(row))
            assert again == row
            assert depth_sha256(replay(again)) == row.depth_sha256
        assert draw_rows(PRESETS[name], 1, index) == draw_rows(PRESETS[name], 1, index)


def test_people_count_as_clutter() -> None:
    row = next(row for row in ALL if row.scene.people and row.scene.door)
    assert len(clutter_boxes(row.scene)) >= 7 * len(row.scene.people or ())
    assert row.scene.without_clutter().people is None
    assert clutter_boxes(row.scene.without_clutter()) == []
