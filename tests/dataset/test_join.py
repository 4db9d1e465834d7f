# SPDX-License-Identifier: Apache-2.0
"""Joined data sets hold the samples of all sources, bit for bit."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from doorstate.dataset.description import DESCRIPTION_FILE
from doorstate.dataset.join import join_datasets
from doorstate.dataset.store import CLOUDS_FILE, PARTS_FILE, PreparedDataset, open_dataset
from doorstate.errors import ConfigError, DatasetError
from doorstate.simulation.manifest import MANIFEST_FILE
from tests.error_fields import about


def test_a_joined_data_set_has_all_clouds_and_parts(scene_dataset: PreparedDataset) -> None:
    folder = scene_dataset.folder.parent
    start = 0
    for name in ("varied-160", "no-door-160"):
        part = open_dataset(folder / name)
        stop = start + len(part)
        assert np.array_equal(scene_dataset.clouds[start:stop], part.clouds)
        assert [row["sample_id"] for row in scene_dataset.rows[start:stop]] == [
            r["sample_id"] for r in part.rows
        ]
        for number in (0, len(part) - 1):
            assert np.array_equal(scene_dataset.parts(start + number), part.parts(number))
        start = stop
    assert len(scene_dataset) == start == 36
    assert scene_dataset.description.source == "varied + no-door"


def test_a_joined_sample_is_rendered_again_from_its_row(scene_dataset: PreparedDataset) -> None:
    for index in (1, 30):
        raw = scene_dataset.raw_cloud(index)
        kept = scene_dataset.cloud(index)
        assert {tuple(p) for p in kept.tolist()} <= {tuple(p) for p in raw.reshape(-1, 3).tolist()}


def test_paper_doors_and_scenes_can_be_joined(
    scene_dataset: PreparedDataset, small_dataset: PreparedDataset, tmp_path: Path
) -> None:
    varied = scene_dataset.folder.parent / "varied-160"
    joined = join_datasets([small_dataset.folder, varied], tmp_path / "joined")
    again = join_datasets([scene_dataset.folder, small_dataset.folder], tmp_path / "again")
    assert again.description.source == "varied + no-door + " + small_dataset.description.source
    raw = joined.raw_cloud(4)
    assert np.array_equal(raw, small_dataset.raw_cloud(4), equal_nan=True)


def test_parts_are_left_out_if_a_source_has_none(scene_dataset: PreparedDataset, tmp_path: Path) -> None:
    folder = scene_dataset.folder.parent
    shutil.copytree(folder / "no-door-160", tmp_path / "blind")
    (tmp_path / "blind" / PARTS_FILE).unlink()
    joined = join_datasets([folder / "varied-160", tmp_path / "blind"], tmp_path / "joined")
    assert not joined.has_parts
    assert len(joined) == 36


def test_a_killed_join_is_repeated(scene_dataset: PreparedDataset, tmp_path: Path) -> None:
    parts = [scene_dataset.folder.parent / name for name in ("varied-160", "no-door-160")]
    folder = tmp_path / "joined"
    whole = join_datasets(parts, folder)
    (folder / DESCRIPTION_FILE).unlink()
    (folder / MANIFEST_FILE).unlink()
    (folder / CLOUDS_FILE).write_bytes(b"old")
    assert len(join_datasets(parts, folder)) == len(whole)
    (folder / DESCRIPTION_FILE).rename(tmp_path / DESCRIPTION_FILE)
    (folder / "notes.txt").touch()
    with pytest.raises(ConfigError, check=about(folder)):
        join_datasets(parts, folder)


def test_the_depth_limit_is_kept_only_if_all_sources_have_one(
    scene_dataset: PreparedDataset, tmp_path: Path
) -> None:
    parts = []
    for name, limit_m in (("varied-160", 2.0), ("no-door-160", 3.0)):
        parts.append(tmp_path / name)
        shutil.copytree(scene_dataset.folder.parent / name, parts[-1])
        description = open_dataset(parts[-1]).description
        description.model_copy(update={"max_depth_m": limit_m}).save(parts[-1])
    assert join_datasets(parts, tmp_path / "both").depth_range_m == 3.0
    parts[0] = scene_dataset.folder.parent / "varied-160"
    assert join_datasets(parts, tmp_path / "one").depth_range_m == scene_dataset.depth_range_m == 5.0


def test_incompatible_sources_are_refused(
    scene_dataset: PreparedDataset, prepared: Path, tmp_path: Path
) -> None:
    varied = scene_dataset.folder.parent / "varied-160"
    with pytest.raises(DatasetError, match="2 samples"):
        join_datasets([varied, varied], tmp_path / "a")
    with pytest.raises(ConfigError, match="40"):
        join_datasets([varied, prepared], tmp_path / "b")
    shutil.copytree(scene_dataset.folder.parent / "no-door-160", tmp_path / "thin")
    open_dataset(varied).description.model_copy(update={"thin": True, "samples": 12}).save(tmp_path / "thin")
    with pytest.raises(ConfigError, match="thin"):
        join_datasets([varied, tmp_path / "thin"], tmp_path / "b")
    with pytest.raises(ConfigError, check=about(varied)):
        join_datasets([varied], varied)
