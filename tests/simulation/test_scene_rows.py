# SPDX-License-Identifier: Apache-2.0
"""Rows of many scenes: in range, by their shares, replayed bit for bit, described truly."""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from doorstate._files import read_csv, write_csv
from doorstate.simulation.doors import leaf_boxes
from doorstate.simulation.frames import replay
from doorstate.simulation.manifest import flatten, unflatten
from doorstate.simulation.no_door import FEATURES
from doorstate.simulation.plan import collide
from doorstate.simulation.scene import Box
from doorstate.simulation.scene_rows import (
    SCENE_PRESETS,
    PresetName,
    ScenePreset,
    SceneRow,
    draw_scene,
    simulate_scene,
)
from doorstate.simulation.scenes import Scene, room_boxes, scene_boxes
from doorstate.simulation.sensor import DepthCamera
from doorstate.types import STATES, Part

SMALL = DepthCamera(width=80, height=60)
VARIED = [draw_scene(SCENE_PRESETS["varied"], 0, index) for index in range(300)]
NO_DOOR = [draw_scene(SCENE_PRESETS["no-door"], 0, index)[0] for index in range(300)]
CLUTTERED = [draw_scene(SCENE_PRESETS["cluttered"], 0, index) for index in range(30)]


def small(name: PresetName) -> ScenePreset:
    return ScenePreset(name=name, camera=SMALL)


def spread(values: list[float], low: float, high: float) -> None:
    assert low <= min(values) < low + 0.1 * (high - low)
    assert high - 0.1 * (high - low) < max(values) <= high


def share(rows: list[SceneRow], condition: object) -> float:
    return sum(bool(condition(row)) for row in rows) / len(rows)  # type: ignore[operator]


def test_every_range_is_kept_and_used() -> None:
    rows = [rows[0] for rows in VARIED]
    spread([row.distance_m for row in rows], 1.5, 3.5)
    spread([row.camera_height_m for row in rows], 0.25, 1.2)
    spread([row.pitch_deg for row in rows], -10, 10)
    spread([row.roll_deg for row in rows], -2, 2)
    spread([row.heading_offset_deg for row in rows], -20, 20)
    assert all(row.y_m >= 0.599 for row in rows)
    doors = [row.scene.door for row in rows]
    spread([door.wall_height_m for door in doors], 2.4, 3.2)
    spread([door.wall_thickness_m for door in doors], 0.08, 0.30)
    spread([door.threshold_m for door in doors], 0.0, 0.02)
    spread([door.opening_width_m for door in doors if not door.is_double], 0.62, 1.05)
    spread([door.opening_width_m for door in doors if door.is_double], 1.25, 2.0)
    spread([door.opening_height_m for door in doors], 1.95, 2.25)
    spread([door.handle.height_m for door in doors if door.handle], 0.85, 1.10)
    spread([row.scene.far.depth_m for row in rows if row.scene.far.depth_m], 1.5, 6.0)


def test_kinds_come_by_their_shares() -> None:
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


def test_the_three_states_of_a_scene_differ_in_the_opening_only() -> None:
    of_its_own = {
        *(
            "sample_id",
            "state",
            "opening_angle_deg",
            "passive_angle_deg",
            "opening_share",
            "passable_width_m",
        ),
        *("occluded_share", "occluded_bin"),
    }
    for rows in VARIED:
        assert [row.state for row in rows] == list(STATES)
        assert len({row.model_dump_json(exclude=of_its_own) for row in rows}) == 1
        assert not any(row.ambiguous for row in rows)
        assert rows[0].passable_width_m < rows[1].passable_width_m < rows[2].passable_width_m + 1e-9
    assert len({rows[0].scene_id for rows in VARIED}) == 300


def test_opening_angles_are_those_of_their_state() -> None:
    hinged = [rows for rows in VARIED if rows[0].opening_share is None]
    slid = [rows for rows in VARIED if rows[0].opening_share is not None]
    for number, (low, high) in enumerate([(0, 3), (15, 65), (75, 115)]):
        angles = [rows[number].opening_angle_deg for rows in hinged]
        assert min(angles) >= low
        assert np.quantile(angles, 0.75) <= high
        wide = np.mean(np.array(angles) > high)
        assert (0.03 < wide < 0.25 and max(angles) <= 170) if number == 2 else wide == 0
    for number, (low, high) in enumerate([(0, 0.03), (0.2, 0.65), (0.8, 1)]):
        assert all(low <= rows[number].opening_share <= high for rows in slid)
        assert all(rows[number].opening_angle_deg is None for rows in slid)


def test_any_angle_is_drawn_from_closed_to_115_degrees() -> None:
    rows = [row for index in range(200) for row in draw_scene(SCENE_PRESETS["varied-angles"], 0, index)]
    angles = [row.opening_angle_deg for row in rows if row.opening_angle_deg is not None]
    # Leaves that cannot turn as far are spread over what they can.
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


def test_nothing_stands_in_anything_else() -> None:
    for rows in [*VARIED[:80], *CLUTTERED]:
        scene = rows[0].scene
        walls = [box for box in room_boxes(scene) if box.part is Part.WALL]
        bare = scene_boxes(scene.model_copy(update={"items": ()}), rows[0].opening())
        items = scene_boxes(scene, rows[0].opening())[len(bare) :]
        camera = Box(Part.OTHER, (rows[0].x_m, rows[0].y_m, rows[0].camera_height_m), (0.2, 0.2, 0.2))
        assert not collide([camera], [*bare, *items], 0.0)
        for row in rows:
            leaves = leaf_boxes(scene.door, row.opening())
            assert not collide(leaves, [*walls, *items, camera])
        assert not collide(items, [box for box in bare if box.part not in (Part.FLOOR, Part.CEILING)], 0.0)


def test_rows_read_back_from_csv_replay_bit_for_bit_in_any_order(tmp_path: Path) -> None:
    drawn = [simulate_scene(small(name), 5, index) for name in SCENE_PRESETS for index in (0, 7)]
    rows = [row for filled, _ in drawn for row in filled]
    frames = {row.sample_id: frame for filled, all3 in drawn for row, frame in zip(filled, all3, strict=True)}
    write_csv(tmp_path / "manifest.csv", [flatten(row) for row in rows])
    for line in reversed(read_csv(tmp_path / "manifest.csv")):
        row = unflatten(line)
        assert row in rows
        again = replay(row)
        assert hashlib.sha256(again.cut.depth_m.tobytes()).hexdigest() == row.depth_sha256
        assert again.points.tobytes() == frames[row.sample_id].points.tobytes()
        assert again.cut.part.tobytes() == frames[row.sample_id].cut.part.tobytes()
    assert len(frames) == 2 * (3 + 3 + 3 + 1)


def test_seeds_presets_and_scenes_draw_their_own() -> None:
    keys = [(name, seed, index) for name in SCENE_PRESETS for seed in (0, 1) for index in (0, 1)]
    widths = [draw_scene(SCENE_PRESETS[name], seed, index)[0].distance_m for name, seed, index in keys]
    assert len(set(widths)) == len(widths)
    assert draw_scene(SCENE_PRESETS["varied"], 0, 7) == VARIED[7]


def to_surface_m(points: np.ndarray, box: Box) -> np.ndarray:
    cos, sin = math.cos(box.yaw_rad), math.sin(box.yaw_rad)
    local = (points - np.array(box.center_m)) @ np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    return np.abs((np.abs(local) - np.array(box.size_m) / 2).max(axis=1))


@pytest.mark.parametrize("name", ["varied", "cluttered"])
def test_every_point_lies_on_the_part_it_is_labelled_with(name: PresetName) -> None:
    seen = set()
    for index in range(8):
        for row in draw_scene(small(name), 2, index):
            frame, boxes = replay(row), row.boxes()
            yaw = math.radians(row.door_yaw_deg)
            rotation = np.array(
                [[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]]
            )
            in_door = (frame.points - np.array([row.door_x_m, row.door_y_m, row.door_z_m])) @ rotation
            for part in set(frame.cut.part.ravel().tolist()) - {int(Part.NONE)}:
                points = in_door[frame.cut.part == part]
                solid = [box for box in boxes if box.part == part and box.material != "glass"]
                assert np.min([to_surface_m(points, box) for box in solid], axis=0).max() < 1e-5
                seen.add(Part(part))
    assert seen >= {Part.WALL, Part.FRAME, Part.LEAF, Part.FLOOR, Part.CEILING}
    assert (Part.OTHER in seen) == (name == "cluttered")


def test_every_frame_shows_much_and_most_show_much_of_the_door() -> None:
    rows = [row for index in range(60) for row in simulate_scene(small("varied"), 0, index)[0]]
    pixels = SMALL.width * SMALL.height
    door = (
        np.array([row.visible_leaf_px + row.visible_frame_px + row.visible_opening_px for row in rows])
        / pixels
    )
    assert min(row.measured_px for row in rows) > 0.4 * pixels
    assert door.min() > 0.02
    assert np.median(door) > 0.25
    # What nobody can tell apart stays rare; twins name one another.
    twins = [row for row in rows if row.same_image_as]
    assert len(twins) < 0.08 * len(rows)
    named = {row.sample_id for row in twins}
    for row in twins:
        assert all(f"{row.scene_id}-{state}" in named for state in row.same_image_as.split())


def test_scenes_without_a_door_say_so_and_have_no_door_columns() -> None:
    for row in NO_DOOR[:50]:
        assert row.state == "no_door"
        assert row.scene.door is None
        boxes = row.boxes()
        assert not {Part.LEAF, Part.FRAME} & {box.part for box in boxes}
        columns = flatten(row)
        assert all(
            columns[name] == "" for name in columns if name.startswith(("door_", "opening_", "passable"))
        )
        assert unflatten(columns) == row


def test_a_scene_has_a_door_or_something_else() -> None:
    with pytest.raises(ValidationError, match="either a door or a feature"):
        Scene.model_validate({"near": {}, "far": {}})
    columns = flatten(VARIED[0][0])
    for damaged in ({"scene": "{"}, {"scene": columns["scene"].replace("opening_width_m", "with_m")}):
        with pytest.raises(Exception, match="manifest line varied-0-00000-closed, column scene"):
            unflatten(columns | damaged)
