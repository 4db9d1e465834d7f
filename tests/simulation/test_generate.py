# SPDX-License-Identifier: Apache-2.0
"""From seeds to rows to frames: drawn in range, replayed bit for bit, described truly."""

from __future__ import annotations

import hashlib
import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from doorstate._files import read_csv, write_csv
from doorstate.errors import ConfigError
from doorstate.io.depth import depth_to_points
from doorstate.simulation.frames import level, replay
from doorstate.simulation.generate import PRESETS, Preset, SampleRow, draw_pose, pose_indices, simulate_pose
from doorstate.simulation.manifest import flatten, unflatten
from doorstate.simulation.placement import half_ring
from doorstate.simulation.scene import Box, build_scene
from doorstate.simulation.sensor import CameraPose, DepthCamera
from doorstate.types import STATES, Part
from tests.simulation import naive_caster

OGUROB, AWAY = PRESETS["ogurob"], PRESETS["ogurob-away"]
AHEAD = half_ring().index((0, 20))


def with_camera(preset: Preset, width: int, height: int) -> Preset:
    return preset.model_copy(update={"camera": DepthCamera(width=width, height=height)})


def to_door_frame(points: NDArray[np.float32], row: SampleRow) -> NDArray[np.float64]:
    """Undo the door's pose in the sensor frame, T_sensor_door."""
    yaw = math.radians(row.door_yaw_deg)
    rotation = np.array([[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]])
    return (points - np.array([row.door_x_m, row.door_y_m, row.door_z_m])) @ rotation


def to_surface_m(points: NDArray[np.float64], box: Box) -> NDArray[np.float64]:
    cos, sin = math.cos(box.yaw_rad), math.sin(box.yaw_rad)
    local = (points - np.array(box.center_m)) @ np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    return np.abs((np.abs(local) - np.array(box.size_m) / 2).max(axis=1))


def test_a_row_read_back_from_csv_replays_bit_for_bit_in_any_order(tmp_path: Path) -> None:
    drawn = {index: simulate_pose(OGUROB, 5, index) for index in (0, 700)}
    rows = [row for filled, _ in drawn.values() for row in filled]
    write_csv(tmp_path / "manifest.csv", [flatten(row) for row in rows])
    frames = {
        row.sample_id: frame
        for filled, all3 in drawn.values()
        for row, frame in zip(filled, all3, strict=True)
    }
    for line in reversed(read_csv(tmp_path / "manifest.csv")):
        row = unflatten(line)
        again = replay(row)
        assert row in rows
        assert hashlib.sha256(again.cut.depth_m.tobytes()).hexdigest() == row.depth_sha256
        assert again.points.tobytes() == frames[row.sample_id].points.tobytes()
        assert again.cut.part.tobytes() == frames[row.sample_id].cut.part.tobytes()
    assert simulate_pose(OGUROB, 5, 700)[0] == drawn[700][0]


@pytest.mark.parametrize("preset", PRESETS.values(), ids=PRESETS)
def test_opening_angles_are_drawn_from_the_range_of_their_state(preset: Preset) -> None:
    drawn: dict[str, list[float]] = {state: [] for state in STATES}
    for index in range(0, 1353, 9):
        rows = draw_pose(preset, 1, index)
        assert [row.state for row in rows] == list(STATES)
        for row in rows:
            drawn[row.state].append(row.opening_angle_deg)
    for state, angles in drawn.items():
        low, high = preset.angles_deg[state]  # type: ignore[index]
        assert low <= min(angles)
        assert max(angles) <= high
        # 151 uniform draws come near to both ends of their range.
        assert max(angles) - min(angles) >= 0.9 * (high - low)


def test_the_three_states_share_one_pose() -> None:
    rows = draw_pose(OGUROB, 1, 44)
    state_of_its_own = {"sample_id", "state", "opening_angle_deg"}
    assert len({row.model_dump_json(exclude=state_of_its_own) for row in rows}) == 1
    assert len({row.sample_id for row in rows}) == 3


def test_heading_and_opening_angles_are_drawn_independently() -> None:
    drawn = []
    for index in range(0, 1353, 3):
        rows = draw_pose(OGUROB, 1, index)
        jitter_deg = math.remainder(rows[0].heading_deg - rows[0].robot_angle_deg - 180, 360)
        drawn.append([jitter_deg, *(row.opening_angle_deg for row in rows)])
    correlation = np.corrcoef(np.array(drawn), rowvar=False)
    assert np.abs(correlation - np.eye(4)).max() < 0.2


def test_seeds_and_poses_draw_their_own() -> None:
    angles = {draw_pose(OGUROB, seed, index)[1].opening_angle_deg for seed in range(5) for index in range(5)}
    assert len(angles) == 25


def test_the_pose_of_a_door_straight_ahead() -> None:
    row = draw_pose(OGUROB, 0, AHEAD)[0]
    offset = math.radians(row.heading_deg + 90)  # the robot stands at y = 2 m and would look along -y
    assert row.door_x_m == pytest.approx(2 * math.cos(offset))
    assert row.door_y_m == pytest.approx(-2 * math.sin(offset))
    assert row.door_z_m == -1.0
    assert row.door_yaw_deg == pytest.approx(90 - math.degrees(offset))
    assert (row.distance_m, row.robot_angle_deg) == (2.0, 90.0)


@pytest.mark.parametrize("pitch_deg", [0.0, 9.0, -12.0])
@pytest.mark.parametrize("preset", [OGUROB, AWAY], ids=["towards", "away"])
def test_every_point_lies_on_the_part_it_is_labelled_with(preset: Preset, pitch_deg: float) -> None:
    seen = set()
    for index in (30, 1100):
        for drawn in draw_pose(with_camera(preset, 160, 120), 2, index):
            row = drawn.model_copy(update={"pitch_deg": pitch_deg})
            frame = replay(row)
            boxes = build_scene(row.door, math.radians(row.opening_angle_deg))
            measured = frame.cut.part != Part.NONE
            assert (measured == np.isfinite(frame.points).all(axis=-1)).all()
            for part in Part:
                points = to_door_frame(frame.points[frame.cut.part == part], row)
                if part is Part.NONE or not len(points):
                    continue
                seen.add(part)
                apart = np.min([to_surface_m(points, box) for box in boxes if box.part == part], axis=0)
                assert apart.max() < 1e-5, part
                if part is Part.FLOOR:
                    np.testing.assert_allclose(points[:, 2], 0, atol=1e-5)
    assert seen == {Part.WALL, Part.FRAME, Part.LEAF, Part.FLOOR}


def test_levelling_keeps_a_level_camera_untouched_and_undoes_a_pitch() -> None:
    points = np.array([[[1.0, 2.0, 0.0], [0.0, 0.0, 1.0]]], np.float32)
    assert level(points, 0.0) is points
    # Looking straight down, ahead is below and up is ahead.
    np.testing.assert_allclose(level(points, math.pi / 2), [[[0, 2, -1], [1, 0, 0]]], atol=1e-7)


@pytest.mark.parametrize(
    ("preset", "index"), [(OGUROB, 10), (OGUROB, 900), (AWAY, 24), (PRESETS["ogurob-fixed"], 400)]
)
def test_what_is_seen_of_the_door_is_counted(preset: Preset, index: int) -> None:
    for row in simulate_pose(with_camera(preset, 40, 30), 0, index)[0]:
        boxes = build_scene(row.door, math.radians(row.opening_angle_deg))
        pose = CameraPose(row.x_m, row.y_m, row.camera_height_m, math.radians(row.heading_deg))
        camera = row.camera.intrinsics()
        depth, part = naive_caster.cast(boxes, pose, camera)
        part[(depth <= 0.4) | (depth >= 5.0)] = Part.NONE
        into_opening = 0
        for v in range(camera.height):
            for u in range(camera.width):
                ray = naive_caster.pixel_ray(v, u, pose, camera)
                reach = -pose.y_m / ray[1]
                x, z = pose.x_m + reach * ray[0], pose.z_m + reach * ray[2]
                meets = reach > 0 and abs(x) < 0.45 and 0 < z < 2.1
                into_opening += meets and depth[v, u] >= reach - 1e-4
        assert row.visible_opening_px == into_opening
        assert row.measured_px == (part != Part.NONE).sum()
        assert row.visible_leaf_px == (part == Part.LEAF).sum()
        assert row.visible_frame_px == (part == Part.FRAME).sum()


def test_the_opening_is_seen_where_it_is() -> None:
    # 2 m before the door, 1 m high: 0.9 m wide, and from 1 m below to the image's upper edge.
    fixed = PRESETS["ogurob-fixed"]
    row = simulate_pose(fixed, 0, AHEAD)[0][2]
    camera = row.camera.intrinsics()
    rays = depth_to_points(np.ones((480, 640), np.float32), camera)
    offset = math.radians(row.heading_deg + 90)
    across = 2 / (np.cos(offset) - rays[..., 1] * np.sin(offset))  # z-depth of the wall's face
    sideways = across * (np.sin(offset) + rays[..., 1] * np.cos(offset))
    inside = (np.abs(sideways) < 0.45) & (across * rays[..., 2] > -1)
    # The open leaf of this door stands on the left and hides nothing but a strip of the opening's edge.
    assert 0.9 * inside.sum() < row.visible_opening_px <= inside.sum()


def test_states_that_look_the_same_are_named() -> None:
    rows, frames = simulate_pose(AWAY, 0, 24)  # the leaf swings out of sight behind the wall
    assert {row.state: row.same_image_as for row in rows} == {
        "closed": "",
        "semi_open": "open",
        "open": "semi_open",
    }
    np.testing.assert_allclose(frames[1].cut.depth_m, frames[2].cut.depth_m, atol=1e-4)
    assert rows[1].visible_leaf_px == rows[2].visible_leaf_px == 0


@pytest.mark.parametrize("index", [0, 24, 600, 1352])
def test_a_door_that_opens_towards_the_robot_always_shows_its_state(index: int) -> None:
    assert [row.same_image_as for row in simulate_pose(with_camera(OGUROB, 80, 60), 0, index)[0]] == [
        "",
        "",
        "",
    ]


def test_poses_are_found_or_refused_in_one_line() -> None:
    assert pose_indices(None) == list(range(1353))
    assert len(pose_indices(7)) == 7
    for poses in (0, 1354):
        with pytest.raises(ConfigError, match=f"^--poses {poses}: there are 1353 positions"):
            pose_indices(poses)
