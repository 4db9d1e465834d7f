# SPDX-License-Identifier: Apache-2.0
"""Simulations in shards give the same bytes as in one run."""

from __future__ import annotations

from pathlib import Path

import pytest

from doorstate._jobs import Shard
from doorstate.errors import ConfigError
from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.manifest import MANIFEST_FILE
from doorstate.simulation.presets import Preset, PresetName
from doorstate.simulation.settings import SimulationSettings
from doorstate.simulation.writer import read_settings, simulate_dataset, simulate_shard
from tests.error_fields import about

CAMERA = DepthCamera(width=40, height=30)


def settings_of(name: PresetName, scenes: int, seed: int = 3, sensor: str = "none") -> SimulationSettings:
    preset = Preset(name=name, camera=CAMERA)
    return SimulationSettings(preset=preset, seed=seed, poses=scenes, sensor=sensor, raw=("depth",))


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.mark.parametrize(
    ("name", "sensor"),
    [
        ("varied", "none"),
        ("varied", "gaussian:0.02"),
        ("cluttered", "none"),
        ("no-door", "none"),
        ("varied-angles", "gaussian:0.02"),
    ],
)
def test_shards_in_any_order_join_to_the_same_bytes(tmp_path: Path, name: PresetName, sensor: str) -> None:
    settings = settings_of(name, 20, sensor=sensor)
    whole = simulate_dataset(tmp_path / "whole", settings, 1)
    for shard in ("3/3", "1/3", "3/3"):
        simulate_shard(tmp_path / "shared", settings, Shard.parse(shard), 1)
    assert not (tmp_path / "shared" / MANIFEST_FILE).exists()
    assert sorted(path.name for path in (tmp_path / "shared" / "pieces").iterdir()) == [
        "00000.csv",
        "00002.csv",
    ]
    # The second shard is missing: joining simulates it.
    steps: list[tuple[int, int]] = []
    assert simulate_dataset(tmp_path / "shared", settings, 1, lambda *step: steps.append(step)) == whole
    assert steps == [(2, 3), (3, 3)]
    assert contents(tmp_path / "shared") == contents(tmp_path / "whole")


@pytest.mark.parametrize("sensor", ["xtion", "d435"])
def test_sensor_noise_does_not_depend_on_shards_or_workers(tmp_path: Path, sensor: str) -> None:
    settings = settings_of("varied", 9, sensor=sensor)
    whole = simulate_dataset(tmp_path / "whole", settings, 1)
    simulate_shard(tmp_path / "shared", settings, Shard.parse("2/2"), 1)
    assert simulate_dataset(tmp_path / "shared", settings, 2) == whole
    assert contents(tmp_path / "shared") == contents(tmp_path / "whole")


def test_pieces_of_several_folders_can_be_copied_together(tmp_path: Path) -> None:
    settings = settings_of("varied", 16)
    for number in (1, 2):
        simulate_shard(tmp_path / str(number), settings, Shard(number, 2), 1)
    for piece in (tmp_path / "2" / "pieces").iterdir():
        piece.rename(tmp_path / "1" / "pieces" / piece.name)
    steps: list[tuple[int, int]] = []
    joined = simulate_dataset(tmp_path / "1", settings, 1, lambda *step: steps.append(step))
    assert steps == [(2, 2)]
    assert joined == simulate_dataset(tmp_path / "whole", settings, 1)


def test_a_larger_data_set_begins_with_the_same_scenes(tmp_path: Path) -> None:
    few = simulate_dataset(tmp_path / "few", settings_of("varied", 3), 1)
    many = simulate_dataset(tmp_path / "many", settings_of("varied", 10), 1)
    assert many[:9] == few


def test_a_shard_of_other_settings_is_refused_and_a_complete_folder_unchanged(tmp_path: Path) -> None:
    settings = settings_of("no-door", 2)
    simulate_dataset(tmp_path / "data", settings, 1)
    before = contents(tmp_path / "data")
    simulate_shard(tmp_path / "data", settings, Shard(1, 2), 1)
    assert contents(tmp_path / "data") == before
    for changed in (settings_of("no-door", 3), settings_of("varied", 2), settings_of("no-door", 2, seed=4)):
        with pytest.raises(ConfigError, check=about(tmp_path / "data")):
            simulate_shard(tmp_path / "data", changed, Shard(1, 2), 1)
    assert read_settings(tmp_path / "data") == settings
