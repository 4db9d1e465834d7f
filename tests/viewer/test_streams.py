# SPDX-License-Identifier: Apache-2.0
"""Clouds that arrive over time: watched folders, replayed stamps and limited rates."""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from doorstate.viewer.named_clouds import NamedCloud
from doorstate.viewer.streams import limit_rate, replay_stamps, watch_folder

CLOUD = np.random.default_rng(0).uniform(1, 3, (200, 3)).astype(np.float32)


def save(path: Path, offset_m: float = 0.0) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    np.save(path, CLOUD + np.float32(offset_m))


def test_watched_folder_yields_present_added_and_changed_files(tmp_path: Path) -> None:
    folder = tmp_path / "incoming"
    watched = watch_folder(folder, poll_period_s=0.02)
    save(folder / "2.npy")
    save(folder / "10.npy")
    assert [cloud.name for cloud in islice(watched, 2)] == ["2.npy", "10.npy"]
    save(folder / "1.npy")
    assert next(watched).name == "1.npy"
    save(folder / "2.npy", 1.0)
    changed = next(watched)
    assert changed.name == "2.npy"
    np.testing.assert_array_equal(changed.cloud, CLOUD + 1)


def test_incomplete_file_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save(tmp_path / "whole" / "a.npy")
    whole = (tmp_path / "whole" / "a.npy").read_bytes()
    target = tmp_path / "incoming" / "a.npy"
    target.parent.mkdir()
    steps = iter(range(200, len(whole) + 200, 200))

    def write_more(_: float) -> None:
        if (end := next(steps, None)) is not None:
            target.write_bytes(whole[:end])

    monkeypatch.setattr(time, "sleep", write_more)
    cloud = next(watch_folder(target.parent))
    np.testing.assert_array_equal(cloud.cloud, CLOUD)


def stamps(*seconds: float) -> Iterator[tuple[float, NamedCloud]]:
    return ((stamp_s, NamedCloud(str(stamp_s), CLOUD)) for stamp_s in seconds)


@pytest.fixture
def sleeps_s(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Durations of the sleeps, on a clock that only sleeping moves."""
    durations_s: list[float] = []
    monkeypatch.setattr(time, "sleep", durations_s.append)
    monkeypatch.setattr(time, "monotonic", lambda: 1000 + sum(durations_s))
    return durations_s


def test_stamps_are_replayed_with_gaps_cut_to_five_seconds(sleeps_s: list[float]) -> None:
    names = [cloud.name for cloud in replay_stamps(stamps(7.0, 7.5, 9.0, 8.0, 1e9))]
    assert names == ["7.0", "7.5", "9.0", "8.0", "1000000000.0"]
    assert sleeps_s == pytest.approx([0, 0.5, 1.5, 0, 5])


def test_rate_is_limited(sleeps_s: list[float]) -> None:
    assert len(list(limit_rate((cloud for _, cloud in stamps(1, 2, 3)), 4))) == 3
    assert sleeps_s == pytest.approx([0, 0.25, 0.25])
