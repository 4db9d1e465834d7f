# SPDX-License-Identifier: Apache-2.0
"""Preparation of simulated scenes, with and without doors, and in shards."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from doorstate._jobs import Shard
from doorstate.clouds.preparation import CloudSpec
from doorstate.dataset.loader import CloudLoader
from doorstate.dataset.preparation import Preparation
from doorstate.dataset.prepare import prepare_dataset, prepare_shard
from doorstate.dataset.splits import draw_splits
from doorstate.errors import ConfigError
from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.presets import Preset, PresetName
from doorstate.simulation.settings import SimulationSettings
from doorstate.simulation.writer import simulate_dataset
from doorstate.types import STATES, Part
from tests.error_fields import about

POINTS = 256
SPEC = CloudSpec(num_points=POINTS)


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> dict[PresetName, Path]:
    folders: dict[PresetName, Path] = {}
    for name, scenes in (("cluttered", 12), ("no-door", 5)):
        folder = tmp_path_factory.mktemp("scenes") / name
        preset = Preset(name=name, camera=DepthCamera(width=80, height=60))  # type: ignore[arg-type]
        simulate_dataset(folder, SimulationSettings(preset=preset, seed=0, poses=scenes), 1)
        folders[name] = folder  # type: ignore[index]
    return folders


def test_scenes_are_prepared_with_their_parts_and_columns(
    simulated: dict[PresetName, Path], tmp_path: Path
) -> None:
    dataset = prepare_dataset(
        Preparation(simulated["cluttered"], SPEC), tmp_path / "doors", workers=1
    ).dataset
    assert dataset.clouds.shape == (36, POINTS, 3)
    np.testing.assert_array_equal(dataset.labels, list(range(3)) * 12)
    assert {Part.WALL, Part.LEAF, Part.OTHER} <= set(
        np.unique([dataset.parts(n) for n in range(36)]).tolist()
    )
    row = dataset.rows[5]
    assert row["scene_id"] == "cluttered-0-00001"
    assert float(row["opening_width_m"]) > float(row["passable_width_m"]) > 0
    assert row["distance_band"] != "outside"
    np.testing.assert_array_equal(dataset.raw_cloud(5).shape, (60, 80, 3))
    assert dataset.image(5) is not None
    assert len(CloudLoader(dataset, [row["sample_id"] for row in dataset.rows], 64)) == 36
    assert len(draw_splits(dataset.rows, "paper", 0)) == 5


def test_scenes_without_a_door_have_their_own_label_and_need_a_door_head(
    simulated: dict[PresetName, Path], tmp_path: Path
) -> None:
    dataset = prepare_dataset(Preparation(simulated["no-door"], SPEC), tmp_path / "none", workers=1).dataset
    assert dataset.labels.tolist() == [len(STATES)] * 5
    with pytest.raises(ConfigError, match="5 samples show no door"):
        CloudLoader(dataset, [row["sample_id"] for row in dataset.rows], 64)


def test_preparation_in_shards_joins_to_the_same_bytes(
    simulated: dict[PresetName, Path], tmp_path: Path
) -> None:
    source = simulated["cluttered"]
    prepare_dataset(Preparation(source, SPEC), tmp_path / "whole", workers=1)
    for number in (2, 1):
        prepare_shard(
            Preparation(source, SPEC),
            tmp_path / "shared",
            Shard(number, 2),
            workers=1,
        )
    steps: list[tuple[int, int]] = []
    prepare_dataset(
        Preparation(source, SPEC),
        tmp_path / "shared",
        workers=1,
        progress=lambda *step: steps.append(step),
    )
    assert steps == [(2, 2)]
    whole, shared = (
        {path.name: path.read_bytes() for path in (tmp_path / name).iterdir()} for name in ("whole", "shared")
    )
    assert whole == shared
    with pytest.raises(ConfigError, check=about(tmp_path / "shared")):
        prepare_shard(
            Preparation(source, CloudSpec(num_points=128)), tmp_path / "shared", Shard(1, 2), workers=1
        )
