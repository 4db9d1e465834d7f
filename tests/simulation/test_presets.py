# SPDX-License-Identifier: Apache-2.0
"""Rows that presets draw: in range, by their shares, reproducible, and geometrically consistent."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest

from doorstate.errors import ConfigError
from doorstate.simulation.draw.half_ring import half_ring
from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.simulation.row import Row
from doorstate.simulation.scene import Box, scene_boxes
from doorstate.simulation.scene.door_boxes import leaf_boxes
from doorstate.simulation.scene.feature import FEATURES
from doorstate.simulation.scene.plan import collide
from doorstate.simulation.scene.scene import room_boxes
from doorstate.types import STATES, Part

OGUROB = PRESETS["ogurob"]
AHEAD = half_ring().index((0, 20))
VARIED = [draw_rows(PRESETS["varied"], 0, index) for index in range(300)]
NO_DOOR = [draw_rows(PRESETS["no-door"], 0, index)[0] for index in range(300)]
CLUTTERED = [draw_rows(PRESETS["cluttered"], 0, index) for index in range(30)]
RANGES_DEG = [(0.0, 3.0), (15.0, 65.0), (75.0, 115.0)]
OF_THE_OPENING = {
    "sample_id",
    "state",
    "opening_angle_deg",
    "passive_angle_deg",
    "opening_share",
    "passable_width_m",
}


def assert_spread(values: list[float], low: float, high: float) -> None:
    """Assert that values lie in a range and reach both of its outer tenths."""
    assert low <= min(values) < low + 0.1 * (high - low)
    assert high - 0.1 * (high - low) < max(values) <= high


def share(rows: list[Row], condition: Callable[[Row], bool]) -> float:
    return sum(condition(row) for row in rows) / len(rows)


@pytest.mark.parametrize(
    ("preset", "ranges"),
    [
        ("ogurob", RANGES_DEG),
        ("ogurob-away", RANGES_DEG),
        ("ogurob-fixed", [(0.0, 0.0), (45.0, 45.0), (90.0, 90.0)]),
    ],
)
def test_paper_presets_draw_angles_from_the_range_of_each_state(
    preset: str, ranges: list[tuple[float, float]]
) -> None:
    drawn = [draw_rows(PRESETS[preset], 1, index) for index in range(0, 1353, 9)]
    assert all([row.state for row in rows] == list(STATES) for rows in drawn)
    for number, (low, high) in enumerate(ranges):
        angles = [rows[number].opening_angle_deg for rows in drawn]
        assert low <= min(angles)
        assert max(angles) <= high
        # 151 uniform draws come near to both ends of their range.
        assert max(angles) - min(angles) >= 0.9 * (high - low)


def test_paper_presets_show_one_door_without_rooms() -> None:
    rows = [row for preset in ("ogurob", "ogurob-away") for row in draw_rows(PRESETS[preset], 0, 7)]
    assert {row.scene_id for row in rows} == {""}
    assert {row.swing for row in rows} == {"towards", "away"}
    for row in rows:
        assert (row.door_kind, row.hinge, row.opening_width_m) == ("single", "left", 0.9)
        assert {box.part for box in row.boxes()} == {Part.WALL, Part.FRAME, Part.LEAF, Part.FLOOR}


@pytest.mark.parametrize("rows", [draw_rows(OGUROB, 1, 44), *VARIED[:100]], ids=lambda rows: rows[0].pose_id)
def test_the_states_of_a_pose_differ_in_the_opening_only(rows: list[Row]) -> None:
    assert [row.state for row in rows] == list(STATES)
    assert len({row.model_dump_json(exclude=OF_THE_OPENING) for row in rows}) == 1
    assert len({row.sample_id for row in rows}) == 3
    assert not any(row.ambiguous for row in rows)
    widths = [row.passable_width_m for row in rows]
    assert widths[0] < widths[1] < widths[2] + 1e-9


def test_heading_and_opening_angles_of_the_paper_are_independent() -> None:
    drawn = []
    for index in range(0, 1353, 3):
        rows = draw_rows(OGUROB, 1, index)
        offset_deg = math.remainder(rows[0].heading_deg - rows[0].robot_angle_deg - 180, 360)
        assert rows[0].heading_offset_deg == pytest.approx(offset_deg, abs=1e-6)
        drawn.append([offset_deg, *(row.opening_angle_deg for row in rows)])
    correlation = np.corrcoef(np.array(drawn), rowvar=False)
    assert np.abs(correlation - np.eye(4)).max() < 0.2


def test_presets_seeds_and_poses_have_their_own_numbers() -> None:
    angles = {draw_rows(OGUROB, seed, index)[1].opening_angle_deg for seed in range(5) for index in range(5)}
    assert len(angles) == 25
    many = [name for name, preset in PRESETS.items() if preset.has_many_scenes]
    keys = [(name, seed, index) for name in many for seed in (0, 1) for index in (0, 1)]
    distances = [draw_rows(PRESETS[name], seed, index)[0].distance_m for name, seed, index in keys]
    assert len(set(distances)) == len(distances)
    assert draw_rows(PRESETS["varied"], 0, 7) == VARIED[7]
    assert len({rows[0].scene_id for rows in VARIED}) == 300


def test_the_door_pose_straight_ahead() -> None:
    row = draw_rows(OGUROB, 0, AHEAD)[0]
    offset = math.radians(row.heading_deg + 90)  # the robot stands at y = 2 m and faces -y
    assert row.door_x_m == pytest.approx(2 * math.cos(offset))
    assert row.door_y_m == pytest.approx(-2 * math.sin(offset))
    assert row.door_z_m == -1.0
    assert row.door_yaw_deg == pytest.approx(90 - math.degrees(offset))
    assert (row.distance_m, row.robot_angle_deg) == (2.0, 90.0)


def test_pose_numbers_of_presets() -> None:
    assert OGUROB.indices() == list(range(1353))
    assert len(OGUROB.indices(7)) == 7
    assert PRESETS["varied"].indices() == list(range(1000))
    assert PRESETS["varied"].indices(3) == [0, 1, 2]
    for poses in (0, 1354):
        with pytest.raises(ConfigError) as refused:
            OGUROB.indices(poses)
        assert refused.value.field == "poses"


def test_varied_scenes_use_the_whole_ranges() -> None:
    rows = [rows[0] for rows in VARIED]
    assert_spread([row.distance_m for row in rows], 1.5, 3.5)
    assert_spread([row.camera_height_m for row in rows], 0.25, 1.2)
    assert_spread([row.pitch_deg for row in rows], -10, 10)
    assert_spread([row.roll_deg for row in rows], -2, 2)
    assert_spread([row.heading_offset_deg for row in rows], -20, 20)
    assert all(row.y_m >= 0.599 for row in rows)
    doors = [row.scene.door for row in rows]
    assert_spread([door.wall_height_m for door in doors], 2.4, 3.2)
    assert_spread([door.wall_thickness_m for door in doors], 0.08, 0.30)
    assert_spread([door.threshold_m for door in doors], 0.0, 0.02)
    assert_spread([door.opening_width_m for door in doors if not door.is_double], 0.62, 1.05)
    assert_spread([door.opening_width_m for door in doors if door.is_double], 1.25, 2.0)
    assert_spread([door.opening_height_m for door in doors], 1.95, 2.25)
    assert_spread([door.handle.height_m for door in doors if door.handle], 0.85, 1.10)
    assert_spread([row.scene.far.depth_m for row in rows if row.scene.far.depth_m], 1.5, 6.0)


def test_kinds_have_their_shares() -> None:
    rows = [rows[0] for rows in VARIED]
    assert share(rows, lambda row: row.door_kind == "single") == pytest.approx(0.5, abs=0.1)
    for kind in ("double_equal", "double_unequal", "sliding", "glazed", "full_glass"):
        assert share(rows, lambda row, kind=kind: row.door_kind == kind) == pytest.approx(0.1, abs=0.05)
    assert share(rows, lambda row: row.hinge == "left") == pytest.approx(0.5, abs=0.1)
    assert share(rows, lambda row: row.swing == "away") == pytest.approx(0.5, abs=0.1)
    assert share(rows, lambda row: row.scene.far.depth_m is None) == pytest.approx(0.25, abs=0.08)
    hinged = [row for row in rows if row.door_kind != "sliding"]
    assert share(hinged, lambda row: row.scene.door.leaf_recess_m == 0) == pytest.approx(0.5, abs=0.1)
    kinds = Counter(row.scene_kind for row in NO_DOOR)
    assert set(kinds) == set(FEATURES)
    assert all(abs(count / 300 - 1 / 7) < 0.07 for count in kinds.values())


def test_varied_scenes_draw_openings_from_the_range_of_each_state() -> None:
    hinged = [rows for rows in VARIED if rows[0].opening_share is None]
    sliding = [rows for rows in VARIED if rows[0].opening_share is not None]
    for number, (low, high) in enumerate(RANGES_DEG):
        angles = [rows[number].opening_angle_deg for rows in hinged]
        assert min(angles) >= low
        assert np.quantile(angles, 0.75) <= high
        wide = np.mean(np.array(angles) > high)
        assert (0.03 < wide < 0.25 and max(angles) <= 170) if number == 2 else wide == 0
    for number, (low, high) in enumerate([(0, 0.03), (0.2, 0.65), (0.8, 1)]):
        assert all(low <= rows[number].opening_share <= high for rows in sliding)
        assert all(rows[number].opening_angle_deg is None for rows in sliding)


def test_varied_angles_are_uniform_from_closed_to_115_degrees() -> None:
    rows = [row for index in range(200) for row in draw_rows(PRESETS["varied-angles"], 0, index)]
    angles = [row.opening_angle_deg for row in rows if row.opening_angle_deg is not None]
    # A leaf that does not turn that far is uniform up to its free angle.
    counts, _ = np.histogram(angles, bins=np.linspace(0, 115, 6))
    assert counts.sum() == len(angles)
    assert counts[:4] / len(angles) == pytest.approx(0.2, abs=0.06)
    assert counts[4] > 0.1 * len(angles)
    for row in rows:
        if row.opening_angle_deg is not None:
            between = 3 < row.opening_angle_deg < 15 or 65 < row.opening_angle_deg < 75
            assert row.ambiguous == between
    assert [row.sample_id[-3:] for row in rows[:3]] == ["-a0", "-a1", "-a2"]
    assert 0.1 < np.mean([row.ambiguous for row in rows]) < 0.35


@pytest.mark.parametrize("rows", [*VARIED[:80], *CLUTTERED], ids=lambda rows: rows[0].pose_id)
def test_nothing_collides(rows: list[Row]) -> None:
    scene = rows[0].scene
    walls = [box for box in room_boxes(scene) if box.part is Part.WALL]
    bare = scene_boxes(scene.model_copy(update={"items": ()}), rows[0].opening())
    items = scene_boxes(scene, rows[0].opening())[len(bare) :]
    camera = Box(Part.OTHER, (rows[0].x_m, rows[0].y_m, rows[0].camera_height_m), (0.2, 0.2, 0.2))
    assert not collide([camera], [*bare, *items], 0.0)
    for row in rows:
        assert not collide(leaf_boxes(scene.door, row.opening()), [*walls, *items, camera])
    assert not collide(items, [box for box in bare if box.part not in (Part.FLOOR, Part.CEILING)], 0.0)


def test_scenes_without_a_door_have_no_door_columns() -> None:
    for row in NO_DOOR[:50]:
        assert row.state == "no_door"
        assert row.scene.door is None
        assert not {Part.LEAF, Part.FRAME} & {box.part for box in row.boxes()}
        columns = row.model_dump()
        door_columns = [name for name in columns if name.startswith(("door_", "opening_", "passable"))]
        assert len(door_columns) == 10
        assert not any(columns[name] for name in door_columns)
