# SPDX-License-Identifier: Apache-2.0
"""Clouds that arrive over time, from a folder or a bag."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from doorstate.dataset.frame_index import IndexedOptions
from doorstate.errors import CloudReadError
from doorstate.io.find import find_clouds
from doorstate.io.options import DEFAULT_OPTIONS, ReadOptions
from doorstate.viewer.named_clouds import NamedCloud, read_named_cloud

if TYPE_CHECKING:
    from doorstate.io.bags import StampedCloud

_MAX_GAP_S = 5.0  # stamps can be hours apart where a clock was set


def watch_folder(
    folder: Path, options: ReadOptions = DEFAULT_OPTIONS, *, poll_period_s: float = 0.2
) -> Iterator[NamedCloud]:
    """Yield the clouds of a folder in order, then those that are added or changed, without end.

    A file is read once its size and time are the same in two consecutive polls, so that it is complete.

    Args:
        folder: folder to watch; may be empty or missing at first.
        options: how files are read.
        poll_period_s: seconds between two polls.
    """
    previous: dict[Path, tuple[int, int]] = {}
    done: dict[Path, tuple[int, int]] = {}
    indexed = IndexedOptions(options)
    while True:
        current = _file_versions(folder)
        ready = [path for path, version in current.items() if previous.get(path) == version != done.get(path)]
        for path in ready:
            done[path] = current[path]
            yield read_named_cloud(path, folder.absolute(), indexed)
        previous = current
        time.sleep(0 if ready else poll_period_s)


def _file_versions(folder: Path) -> dict[Path, tuple[int, int]]:
    """Return size and modification time of each cloud file in order; empty if the folder has no clouds."""
    try:
        stats = [(path, path.stat()) for path in find_clouds([folder])]
    except (CloudReadError, OSError):  # no clouds, no folder, or a file that was removed meanwhile
        return {}
    return {path: (stat.st_size, stat.st_mtime_ns) for path, stat in stats}


def name_messages(messages: Iterable[StampedCloud]) -> Iterator[tuple[float, NamedCloud]]:
    """Yield stamps in seconds and clouds of a bag; a bag that is damaged from somewhere on ends with the error."""
    stamp_s = 0.0
    try:
        for stamp_s, _, cloud, pose in messages:
            yield stamp_s, NamedCloud(f"{stamp_s:.3f} s", cloud, pose=pose)
    except CloudReadError as error:
        yield stamp_s, NamedCloud("end", error)


def limit_rate(clouds: Iterable[NamedCloud], rate_hz: float) -> Iterator[NamedCloud]:
    """Yield clouds at no more than `rate_hz` per second."""
    due_s = -math.inf
    for cloud in clouds:
        time.sleep(max(0.0, due_s - time.monotonic()))
        due_s = time.monotonic() + 1 / rate_hz
        yield cloud


def replay_stamps(clouds: Iterable[tuple[float, NamedCloud]]) -> Iterator[NamedCloud]:
    """Yield clouds at the pace of their stamps in seconds; gaps are cut to five seconds."""
    due_s, last_s = time.monotonic(), math.inf
    for stamp_s, cloud in clouds:
        due_s += min(max(0.0, stamp_s - last_s), _MAX_GAP_S)
        last_s = stamp_s
        time.sleep(max(0.0, due_s - time.monotonic()))
        yield cloud
