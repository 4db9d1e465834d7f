# SPDX-License-Identifier: Apache-2.0
"""Clouds from files, prepared data sets and simulated folders, with parts and true state where known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from doorstate.dataset.store import PreparedDataset
from doorstate.errors import CloudReadError, DatasetError
from doorstate.simulation.frames import replay
from doorstate.simulation.manifest import unflatten
from doorstate.types import Part
from doorstate.viewer.named_clouds import find_named_clouds

CLOUD = np.random.default_rng(0).uniform(1, 3, (200, 3)).astype(np.float32)


def save(path: Path, value: float = 0.0) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    np.save(path, CLOUD + np.float32(value))


def test_names_are_relative_to_the_common_folder(tmp_path: Path) -> None:
    save(tmp_path / "run" / "open" / "10.npy")
    save(tmp_path / "run" / "open" / "9.npy")
    save(tmp_path / "run" / "other.npy")
    (tmp_path / "run" / "broken.pcd").write_bytes(b"garbage")
    paths = [tmp_path / "run" / "open", tmp_path / "run" / "other.npy", tmp_path / "run" / "broken.pcd"]
    clouds = [read() for read in find_named_clouds(paths)]
    assert [cloud.name for cloud in clouds] == ["open/9.npy", "open/10.npy", "other.npy", "broken.pcd"]
    assert [type(cloud.cloud) for cloud in clouds] == [np.ndarray] * 3 + [CloudReadError]
    assert {(cloud.parts, cloud.truth) for cloud in clouds} == {(None, "")}


def test_missing_path_and_incomplete_simulation_raise(tmp_path: Path) -> None:
    with pytest.raises(CloudReadError, match=r"gone\.pcd"):
        find_named_clouds([tmp_path / "gone.pcd"])
    (tmp_path / "begun").mkdir()
    (tmp_path / "begun" / "simulation.json").write_text("{}")
    with pytest.raises(DatasetError):
        find_named_clouds([tmp_path / "begun"])


def test_simulated_clouds_have_parts_and_truth(
    simulated_folder: Path, small_dataset: PreparedDataset
) -> None:
    whole = find_named_clouds([simulated_folder])
    prepared = find_named_clouds([small_dataset.folder])
    assert len(whole) == len(prepared) == len(small_dataset)
    raw, sampled, row = whole[2](), prepared[2](), small_dataset.rows[2]
    assert (raw.name, raw.truth) == (sampled.name, sampled.truth) == (row["sample_id"], row["state"])
    frame = replay(unflatten(row))
    np.testing.assert_array_equal(raw.cloud, frame.points)
    assert raw.parts is not None
    assert raw.parts.shape == (frame.points.size // 3,)
    np.testing.assert_array_equal(raw.parts == Part.NONE, ~np.isfinite(frame.points[..., 0]).reshape(-1))
    np.testing.assert_array_equal(sampled.cloud, small_dataset.cloud(2))
    np.testing.assert_array_equal(sampled.parts, small_dataset.parts(2))
