# SPDX-License-Identifier: Apache-2.0
"""Clouds to look at: what is known of them comes along, and a folder is watched as it fills."""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from doorstate.dataset.store import PreparedDataset
from doorstate.errors import CloudReadError, DatasetError
from doorstate.simulation.frames import replay
from doorstate.simulation.manifest import unflatten
from doorstate.types import Part
from doorstate.viewer.named_clouds import (
    NamedCloud,
    as_stamped,
    at_rate,
    find_named_clouds,
    watch_folder,
)

CLOUD = np.random.default_rng(0).uniform(1, 3, (200, 3)).astype(np.float32)


def save(path: Path, value: float = 0.0) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    np.save(path, CLOUD + np.float32(value))


def test_files_are_named_from_the_folder_they_share(tmp_path: Path) -> None:
    save(tmp_path / "run" / "open" / "10.npy")
    save(tmp_path / "run" / "open" / "9.npy")
    save(tmp_path / "run" / "other.npy")
    (tmp_path / "run" / "broken.pcd").write_bytes(b"garbage")
    paths = [tmp_path / "run" / "open", tmp_path / "run" / "other.npy", tmp_path / "run" / "broken.pcd"]
    seen = [sighting() for sighting in find_named_clouds(paths)]
    assert [each.name for each in seen] == ["open/9.npy", "open/10.npy", "other.npy", "broken.pcd"]
    assert [type(each.cloud) for each in seen] == [np.ndarray] * 3 + [CloudReadError]
    assert {(each.parts, each.truth) for each in seen} == {(None, "")}


def test_a_path_that_is_not_there_is_an_error_at_once(tmp_path: Path) -> None:
    with pytest.raises(CloudReadError, match=r"gone\.pcd"):
        find_named_clouds([tmp_path / "gone.pcd"])
    (tmp_path / "begun").mkdir()
    (tmp_path / "begun" / "simulation.json").write_text("{}")
    with pytest.raises(DatasetError, match="not complete"):
        find_named_clouds([tmp_path / "begun"])


def test_simulated_clouds_come_with_parts_and_truth(
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


def test_a_watched_folder_gives_what_is_there_and_what_comes_in_or_changes(tmp_path: Path) -> None:
    folder = tmp_path / "incoming"
    watched = watch_folder(folder, look_every_s=0.02)
    save(folder / "2.npy")
    save(folder / "10.npy")
    assert [each.name for each in islice(watched, 2)] == ["2.npy", "10.npy"]
    save(folder / "1.npy")
    assert next(watched).name == "1.npy"
    save(folder / "2.npy", 1.0)
    again = next(watched)
    assert again.name == "2.npy"
    np.testing.assert_array_equal(again.cloud, CLOUD + 1)


def test_a_file_is_not_read_before_it_is_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save(tmp_path / "whole" / "a.npy")
    whole = (tmp_path / "whole" / "a.npy").read_bytes()
    target = tmp_path / "incoming" / "a.npy"
    target.parent.mkdir()
    steps = iter(range(200, len(whole) + 200, 200))

    def write_some_more(_: float) -> None:
        if (end := next(steps, None)) is not None:
            target.write_bytes(whole[:end])

    monkeypatch.setattr(time, "sleep", write_some_more)
    seen = next(watch_folder(target.parent))
    np.testing.assert_array_equal(seen.cloud, CLOUD)


def stamps(*seconds: float) -> Iterator[tuple[float, NamedCloud]]:
    return ((stamp_s, NamedCloud(str(stamp_s), CLOUD)) for stamp_s in seconds)


@pytest.fixture
def slept(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """What was slept, on a clock that nothing else moves."""
    found: list[float] = []
    monkeypatch.setattr(time, "sleep", found.append)
    monkeypatch.setattr(time, "monotonic", lambda: 1000 + sum(found))
    return found


def test_stamps_are_kept_but_for_clocks_that_jump(slept: list[float]) -> None:
    names = [each.name for each in as_stamped(stamps(7.0, 7.5, 9.0, 8.0, 1e9))]
    assert names == ["7.0", "7.5", "9.0", "8.0", "1000000000.0"]
    assert slept == pytest.approx([0, 0.5, 1.5, 0, 5])


def test_a_rate_is_a_limit(slept: list[float]) -> None:
    assert len(list(at_rate((each for _, each in stamps(1, 2, 3)), 4))) == 3
    assert slept == pytest.approx([0, 0.25, 0.25])
