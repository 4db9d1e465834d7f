# SPDX-License-Identifier: Apache-2.0
"""Replay of manifest rows: bit for bit, in any order, with every sensor; points lie on their parts."""

from __future__ import annotations

import hashlib
import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from doorstate._files import read_csv, write_csv
from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.frames import level, replay
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.manifest import flatten, unflatten
from doorstate.simulation.noise.sensors import find_sensor
from doorstate.simulation.presets import PRESETS, Preset, PresetName, draw_rows
from doorstate.simulation.row import Row
from doorstate.simulation.scene import Box
from doorstate.types import NO_DOOR, Part

SMALL = DepthCamera(width=80, height=60)
OGUROB = PRESETS["ogurob"]


def small(name: PresetName, width: int = 80, height: int = 60) -> Preset:
    return Preset(name=name, camera=DepthCamera(width=width, height=height))


def to_door_frame(points: NDArray[np.float32], row: Row) -> NDArray[np.float64]:
    """Invert the door's pose in the sensor frame, T_sensor_door."""
    yaw = math.radians(row.door_yaw_deg)
    rotation = np.array([[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]])
    return (points - np.array([row.door_x_m, row.door_y_m, row.door_z_m])) @ rotation


def to_surface_m(points: NDArray[np.float64], box: Box) -> NDArray[np.float64]:
    cos, sin = math.cos(box.yaw_rad), math.sin(box.yaw_rad)
    local = (points - np.array(box.center_m)) @ np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    return np.abs((np.abs(local) - np.array(box.size_m) / 2).max(axis=1))


def check_parts(row: Row) -> set[Part]:
    """Assert that all points lie on boxes of their part, and return the parts of the frame."""
    frame, boxes = replay(row), row.boxes()
    measured = frame.cut.part != Part.NONE
    assert (measured == np.isfinite(frame.points).all(axis=-1)).all()
    parts = set()
    for part in set(frame.cut.part.ravel().tolist()) - {int(Part.NONE)}:
        points = to_door_frame(frame.points[frame.cut.part == part], row)
        solid = [box for box in boxes if box.part == part and box.material != "glass"]
        assert np.min([to_surface_m(points, box) for box in solid], axis=0).max() < 1e-5, part
        if part == Part.FLOOR:
            np.testing.assert_allclose(points[:, 2], 0, atol=1e-5)
        parts.add(Part(part))
    return parts


def test_rows_of_all_presets_replay_bit_for_bit_in_any_order(tmp_path: Path) -> None:
    drawn = [simulate_rows(small(name), 5, index) for name in PRESETS for index in (0, 7)]
    drawn += [simulate_rows(OGUROB, 5, 700)]
    rows = [row for described, _ in drawn for row in described]
    frames = {
        (row.camera.width, row.depth_sha256): frame
        for described, rendered in drawn
        for row, frame in zip(described, rendered, strict=True)
    }
    write_csv(tmp_path / "manifest.csv", [flatten(row) for row in rows])
    for line in reversed(read_csv(tmp_path / "manifest.csv")):
        row = unflatten(line)
        assert row in rows
        again, first = replay(row), frames[row.camera.width, row.depth_sha256]
        assert hashlib.sha256(again.cut.depth_m.tobytes()).hexdigest() == row.depth_sha256
        assert again.points.tobytes() == first.points.tobytes()
        assert again.cut.part.tobytes() == first.cut.part.tobytes()
    without_door = sum(row.state == NO_DOOR for row in rows)
    assert len(rows) == 2 * (len(PRESETS) - 2) * 3 + without_door + 3
    assert without_door == 4


@pytest.mark.parametrize(
    "sensor", ["gaussian:0.02", "xtion", "kinect", "d435", "deepdoors2", "oak-d-pro", "kinect-2"]
)
def test_rows_with_sensor_noise_replay_bit_for_bit(tmp_path: Path, sensor: str) -> None:
    rows = [
        *simulate_rows(small("ogurob"), 0, 700, sensor)[0],
        *simulate_rows(small("cluttered"), 0, 1, sensor)[0],
    ]
    write_csv(tmp_path / "manifest.csv", [flatten(row) for row in rows])
    for row, line in zip(rows, read_csv(tmp_path / "manifest.csv"), strict=True):
        assert line["sensor"] == sensor
        again = unflatten(line)
        assert again == row
        depth_m = replay(again).cut.depth_m
        assert hashlib.sha256(depth_m.tobytes()).hexdigest() == row.depth_sha256
    assert len({row.depth_sha256 for row in rows}) == 6
    # The samples of a pose are measured in the same light.
    assert len({(row.pose_id, row.conditions) for row in rows}) == 2
    model = find_sensor(sensor)
    assert all((row.conditions is None) == (model.kind == "stages") for row in rows)
    own = model.camera
    assert all(row.camera == (SMALL if own == DepthCamera() else own) for row in rows)


@pytest.mark.parametrize("pitch_deg", [0.0, 9.0, -12.0])
@pytest.mark.parametrize("name", ["ogurob", "ogurob-away"])
def test_points_of_the_paper_presets_lie_on_their_parts(name: PresetName, pitch_deg: float) -> None:
    parts = set()
    for index in (30, 1100):
        for row in draw_rows(small(name, 160, 120), 2, index):
            parts |= check_parts(row.model_copy(update={"pitch_deg": pitch_deg}))
    assert parts == {Part.WALL, Part.FRAME, Part.LEAF, Part.FLOOR}


@pytest.mark.parametrize("name", ["varied", "cluttered"])
def test_points_of_many_scenes_lie_on_their_parts(name: PresetName) -> None:
    parts = set()
    for index in range(8):
        for row in draw_rows(small(name), 2, index):
            parts |= check_parts(row)
    assert parts >= {Part.WALL, Part.FRAME, Part.LEAF, Part.FLOOR, Part.CEILING}
    assert (Part.OTHER in parts) == (name == "cluttered")


def test_levelling_keeps_a_level_camera_and_undoes_a_pitch() -> None:
    points = np.array([[[1.0, 2.0, 0.0], [0.0, 0.0, 1.0]]], np.float32)
    assert level(points, 0.0) is points
    # For a camera that looks straight down, forward is down and up is forward.
    np.testing.assert_allclose(level(points, math.pi / 2), [[[0, 2, -1], [1, 0, 0]]], atol=1e-7)
