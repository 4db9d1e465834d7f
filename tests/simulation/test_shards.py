# SPDX-License-Identifier: Apache-2.0
"""Simulations in shares: whatever the sharding, the same bytes."""

from __future__ import annotations

from pathlib import Path

import pytest

from doorstate._jobs import Shard
from doorstate.errors import ConfigError, DatasetError
from doorstate.simulation.run import MANIFEST, read_settings, simulate_dataset, simulate_shard
from doorstate.simulation.scene_rows import PresetName, ScenePreset
from doorstate.simulation.sensor import DepthCamera
from doorstate.simulation.settings import SceneSettings, SimulationSettings, settings_for

CAMERA = DepthCamera(width=40, height=30)


def settings_of(name: PresetName, scenes: int, seed: int = 3, sensor: str = "none") -> SceneSettings:
    preset = ScenePreset(name=name, camera=CAMERA)
    return SceneSettings(preset=preset, seed=seed, scenes=scenes, sensor=sensor, raw=("depth",))


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
    assert not (tmp_path / "shared" / MANIFEST).exists()
    assert sorted(path.name for path in (tmp_path / "shared" / "pieces").iterdir()) == [
        "00000.csv",
        "00002.csv",
    ]
    # The second share was never asked for: joining makes it.
    steps: list[tuple[int, int]] = []
    assert simulate_dataset(tmp_path / "shared", settings, 1, lambda *step: steps.append(step)) == whole
    assert steps == [(2, 3), (3, 3)]
    assert contents(tmp_path / "shared") == contents(tmp_path / "whole")


@pytest.mark.parametrize("sensor", ["xtion", "d435"])
def test_a_cameras_noise_is_the_same_whatever_the_sharding_and_whoever_works(
    tmp_path: Path, sensor: str
) -> None:
    settings = settings_of("varied", 9, sensor=sensor)
    whole = simulate_dataset(tmp_path / "whole", settings, 1)
    simulate_shard(tmp_path / "shared", settings, Shard.parse("2/2"), 1)
    assert simulate_dataset(tmp_path / "shared", settings, 2) == whole
    assert contents(tmp_path / "shared") == contents(tmp_path / "whole")


def test_pieces_made_elsewhere_are_copied_together(tmp_path: Path) -> None:
    settings = settings_of("varied", 16)
    for number in (1, 2):
        simulate_shard(tmp_path / str(number), settings, Shard(number, 2), 1)
    for piece in (tmp_path / "2" / "pieces").iterdir():
        piece.rename(tmp_path / "1" / "pieces" / piece.name)
    steps: list[tuple[int, int]] = []
    joined = simulate_dataset(tmp_path / "1", settings, 1, lambda *step: steps.append(step))
    assert steps == [(2, 2)]
    assert joined == simulate_dataset(tmp_path / "whole", settings, 1)


def test_more_scenes_begin_with_the_same_ones(tmp_path: Path) -> None:
    few = simulate_dataset(tmp_path / "few", settings_of("varied", 3), 1)
    many = simulate_dataset(tmp_path / "many", settings_of("varied", 10), 1)
    assert many[:9] == few


def test_a_shard_of_something_else_is_refused_and_of_a_whole_one_left_alone(tmp_path: Path) -> None:
    settings = settings_of("no-door", 2)
    simulate_dataset(tmp_path / "data", settings, 1)
    before = contents(tmp_path / "data")
    simulate_shard(tmp_path / "data", settings, Shard(1, 2), 1)
    assert contents(tmp_path / "data") == before
    for other in (settings_of("no-door", 3), settings_of("varied", 2), settings_of("no-door", 2, seed=4)):
        with pytest.raises(ConfigError, match="other settings"):
            simulate_shard(tmp_path / "data", other, Shard(1, 2), 1)
    assert read_settings(tmp_path / "data") == settings


def test_settings_are_found_by_the_presets_name() -> None:
    assert settings_for("ogurob", 1, 60, None) == SimulationSettings(
        preset=settings_for("ogurob", 0, None, None).preset, seed=1, poses=60
    )
    varied = settings_for("varied", 0, None, None)
    assert (varied.preset.name, varied.indices()) == ("varied", list(range(1000)))
    assert settings_for("no-door", 0, None, 7).indices() == list(range(7))
    with pytest.raises(ConfigError, match=r"--poses 5: .* choose --scenes"):
        settings_for("varied", 0, 5, None)
    with pytest.raises(ConfigError, match=r"--scenes 5: .* choose --poses"):
        settings_for("ogurob", 0, None, 5)
    with pytest.raises(
        ConfigError, match=r"^no preset 'varies': choose one of ogurob, .*, varied, .*no-door$"
    ):
        settings_for("varies", 0, None, None)


def test_damaged_settings_of_scenes_are_named(tmp_path: Path) -> None:
    text = settings_of("varied", 2).model_dump_json().replace('"varied"', '"colourful"')
    (tmp_path / "simulation.json").write_text(text, encoding="utf-8")
    with pytest.raises(DatasetError, match=r"simulation\.json: "):
        read_settings(tmp_path)
