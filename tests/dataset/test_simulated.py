# SPDX-License-Identifier: Apache-2.0
"""Simulation with preparation in one pass gives the same bytes as two passes."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from doorstate._jobs import Shard
from doorstate.clouds.preparation import CloudSpec
from doorstate.dataset import simulated
from doorstate.dataset.preparation import Preparation
from doorstate.dataset.prepare import prepare_dataset
from doorstate.dataset.simulated import Sampler, simulate_prepared
from doorstate.errors import ConfigError
from doorstate.simulation import writer
from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.presets import Preset, PresetName
from doorstate.simulation.settings import SimulationSettings
from doorstate.simulation.writer import simulate_dataset, simulate_shard
from tests.error_fields import about

NUM_POINTS = 160
SPEC = CloudSpec(num_points=NUM_POINTS)


def settings_of(name: PresetName, scenes: int) -> SimulationSettings:
    preset = Preset(name=name, camera=DepthCamera(width=80, height=60))
    return SimulationSettings(preset=preset, seed=5, poses=scenes)


def preparation_of(source: Path) -> Preparation:
    return Preparation(source, CloudSpec(num_points=NUM_POINTS, max_depth_m=4.0, thin=True))


def contents(folder: Path) -> dict[str, bytes]:
    # preparation.json contains the path of the source.
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "preparation.json"}


@pytest.fixture(scope="module")
def two_passes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("two")
    for name in ("varied", "no-door"):
        simulate_dataset(folder / name, settings_of(name, 10), 1)  # type: ignore[arg-type]
        prepare_dataset(preparation_of(folder / name), folder / f"{name}-160", 1)
    return folder


@pytest.mark.parametrize("name", ["varied", "no-door"])
def test_one_pass_writes_the_same_files(name: PresetName, two_passes: Path, tmp_path: Path) -> None:
    steps: list[tuple[int, int]] = []
    summary = simulate_prepared(
        settings_of(name, 10),
        preparation_of(tmp_path / name),
        tmp_path / "out",
        1,
        lambda *step: steps.append(step),
    )
    assert steps == [(0, 2), (1, 2), (2, 2)]
    assert contents(tmp_path / "out") == contents(two_passes / f"{name}-160")
    assert contents(tmp_path / name) == contents(two_passes / name)
    assert len(summary.dataset) + len(summary.rejected) == (30 if name == "varied" else 10)
    again = prepare_dataset(preparation_of(tmp_path / name), tmp_path / "out", 1)
    assert len(again.dataset) == len(summary.dataset)


def test_shards_are_continued_without_rendering_again(
    two_passes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings, source = settings_of("varied", 10), tmp_path / "varied"
    simulate_shard(source, settings, Shard(2, 2), 1, callback=Sampler(preparation_of(source)))
    rendered: list[int] = []
    simulate = writer._simulate_piece

    def count_and_simulate(piece: writer._Piece, path: Path) -> None:
        rendered.append(len(piece.indices))
        simulate(piece, path)

    monkeypatch.setattr(writer, "_simulate_piece", count_and_simulate)
    monkeypatch.setattr(simulated, "prepare_dataset", None)  # would render again
    simulate_prepared(settings, preparation_of(source), tmp_path / "out", 1)
    assert rendered == [8]
    assert contents(tmp_path / "out") == contents(two_passes / "varied-160")


def test_clouds_that_were_not_sampled_are_rendered_again(two_passes: Path, tmp_path: Path) -> None:
    shutil.copytree(two_passes / "varied", tmp_path / "varied")
    simulate_prepared(settings_of("varied", 10), preparation_of(tmp_path / "varied"), tmp_path / "out", 1)
    assert contents(tmp_path / "out") == contents(two_passes / "varied-160")
    preparation = preparation_of(tmp_path / "varied")._replace(
        spec=CloudSpec(num_points=NUM_POINTS, max_depth_m=4.0)
    )
    with pytest.raises(ConfigError, check=about(tmp_path / "out")):
        simulate_prepared(settings_of("varied", 10), preparation, tmp_path / "out", 1)
