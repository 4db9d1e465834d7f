# SPDX-License-Identifier: Apache-2.0
"""Rows seen by a sensor with its noise: the same scenes, replayed bit for bit, and none without one."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest

from doorstate._files import read_csv, write_csv
from doorstate.errors import ConfigError
from doorstate.simulation.frames import replay
from doorstate.simulation.generate import PRESETS, simulate_pose
from doorstate.simulation.manifest import Row, flatten, unflatten
from doorstate.simulation.noise.models import find_sensor
from doorstate.simulation.scene_rows import ScenePreset, simulate_scene
from doorstate.simulation.sensor import DepthCamera
from doorstate.simulation.settings import settings_for

SMALL = DepthCamera(width=80, height=60)
OGUROB = PRESETS["ogurob"].model_copy(update={"camera": SMALL})
CLUTTERED = ScenePreset(name="cluttered", camera=SMALL)


def simulated(sensor: str) -> list[Row]:
    return [*simulate_pose(OGUROB, 0, 700, sensor)[0], *simulate_scene(CLUTTERED, 0, 1, sensor)[0]]


@pytest.mark.parametrize("sensor", ["gaussian:0.02", "xtion", "kinect", "d435", "deepdoors2"])
def test_rows_read_back_from_csv_replay_bit_for_bit(tmp_path: Path, sensor: str) -> None:
    rows = simulated(sensor)
    write_csv(tmp_path / "manifest.csv", [flatten(row) for row in rows])
    for row, line in zip(rows, read_csv(tmp_path / "manifest.csv"), strict=True):
        assert line["sensor"] == sensor
        again = unflatten(line)
        assert again == row
        depth_m = replay(again).cut.depth_m
        assert hashlib.sha256(depth_m.tobytes()).hexdigest() == row.depth_sha256
    assert len({row.depth_sha256 for row in rows}) == 6
    own = find_sensor(sensor).camera
    assert all(row.camera == (SMALL if own == DepthCamera() else own) for row in rows)


def test_a_sensor_changes_what_is_measured_and_nothing_else() -> None:
    described = {"sensor", "depth_sha256", "measured_px", "visible_leaf_px", "visible_frame_px"}
    for clean, noisy in zip(simulated("none"), simulated("gaussian:0.02"), strict=True):
        assert clean.model_dump_json(exclude=described) == noisy.model_dump_json(exclude=described)
        one, other = replay(clean), replay(noisy)
        assert one.full.depth_m.tobytes() == other.full.depth_m.tobytes()
        both = np.isfinite(one.cut.depth_m) & np.isfinite(other.cut.depth_m)
        assert np.std((one.cut.depth_m - other.cut.depth_m)[both]) == pytest.approx(0.02, rel=0.05)


def test_states_that_only_noise_tells_apart_stay_the_same() -> None:
    away = PRESETS["ogurob-away"].model_copy(update={"camera": SMALL})
    rows = simulate_pose(away, 0, 24, "gaussian:0.01")[0]
    assert [row.same_image_as for row in rows] == ["", "open", "semi_open"]
    assert len({row.depth_sha256 for row in rows}) == 3


def test_manifests_of_the_first_presets_have_a_sensor_column_only_with_a_sensor() -> None:
    assert "sensor" not in flatten(simulate_pose(OGUROB, 0, 700)[0][0])
    assert flatten(simulate_pose(OGUROB, 0, 700, "gaussian")[0][0])["sensor"] == "gaussian"


def test_sensors_are_found_or_refused() -> None:
    assert settings_for("varied", 0, None, 5, (), "xtion").sensor == "xtion"
    with pytest.raises(ConfigError, match="no sensor 'xtions': choose one of none, "):
        settings_for("varied", 0, None, 5, (), "xtions")
