# SPDX-License-Identifier: Apache-2.0
"""Clouds to look at, with what is known of them: from files, from data sets, and from a folder as they come in."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate._files import read_csv
from doorstate.dataset.store import PreparedDataset, is_prepared, open_dataset
from doorstate.errors import CloudReadError, DatasetError, DoorstateError
from doorstate.io.readers import DEFAULT_OPTIONS, ReadOptions, find_clouds, read_cloud
from doorstate.simulation.frames import replay
from doorstate.simulation.manifest import unflatten
from doorstate.simulation.run import MANIFEST, is_simulated
from doorstate.types import Points

_LONGEST_GAP_S = 5.0  # a clock that was set may have left hours between two messages


class NamedCloud(NamedTuple):
    """One cloud."""

    name: str
    cloud: Points | DoorstateError  # as a `Predictor` takes it, or why there is none
    parts: NDArray[np.uint8] | None = None  # of each point of the flattened cloud, where they are known
    truth: str = ""  # the state, where it is known


def find_named_clouds(
    paths: Sequence[Path], options: ReadOptions = DEFAULT_OPTIONS
) -> list[Callable[[], NamedCloud]]:
    """What to call for each cloud in files, folders of files, prepared data sets and simulated folders.

    Raises:
        CloudReadError: a path does not exist, or a folder holds no cloud.
        DatasetError: a data set cannot be used.
    """
    found: list[Callable[[], NamedCloud]] = []
    files: list[Path] = []
    for path in paths:
        if is_prepared(path):
            dataset = open_dataset(path)
            found += [partial(_of_dataset, dataset, index) for index in range(len(dataset))]
        elif is_simulated(path):
            if not (path / MANIFEST).is_file():
                raise DatasetError(f"{path}: the simulation is not complete; run 'doorstate simulate' again")
            found += [partial(_of_simulation, row) for row in read_csv(path / MANIFEST)]
        else:
            files += find_clouds([path])
    shared = os.path.commonpath([file.absolute().parent for file in files]) if files else ""
    return found + [partial(_of_file, file, Path(shared), options) for file in files]


def watch_folder(
    folder: Path, options: ReadOptions = DEFAULT_OPTIONS, *, look_every_s: float = 0.2
) -> Iterator[NamedCloud]:
    """Clouds of a folder's files in their order, then of those that come in or change, without end.

    A file is read once its size and time have stayed the same from one look to the next, so that it may be written
    slowly or written over.

    Args:
        folder: may be empty at first, or come later.
        options: of the files.
        look_every_s: how often to look for new files.
    """
    before: dict[Path, tuple[int, int]] = {}
    done: dict[Path, tuple[int, int]] = {}
    while True:
        now = _written(folder)
        ready = [path for path, when in now.items() if before.get(path) == when != done.get(path)]
        for path in ready:
            done[path] = now[path]
            yield _of_file(path, folder.absolute(), options)
        before = now
        time.sleep(0 if ready else look_every_s)


def at_rate(sightings: Iterable[NamedCloud], rate_hz: float) -> Iterator[NamedCloud]:
    """The same, at most so many a second."""
    due_s = -math.inf
    for sighting in sightings:
        time.sleep(max(0.0, due_s - time.monotonic()))
        due_s = time.monotonic() + 1 / rate_hz
        yield sighting


def as_stamped(sightings: Iterable[tuple[float, NamedCloud]]) -> Iterator[NamedCloud]:
    """The same, as far apart as their stamps in seconds, but never more than 5 s."""
    due_s, last_s = time.monotonic(), math.inf
    for stamp_s, sighting in sightings:
        due_s += min(max(0.0, stamp_s - last_s), _LONGEST_GAP_S)
        last_s = stamp_s
        time.sleep(max(0.0, due_s - time.monotonic()))
        yield sighting


def _of_file(path: Path, folder: Path, options: ReadOptions) -> NamedCloud:
    name = path.absolute().relative_to(folder).as_posix()
    try:
        return NamedCloud(name, read_cloud(path, options))
    except DoorstateError as error:
        return NamedCloud(name, error)


def _of_dataset(dataset: PreparedDataset, index: int) -> NamedCloud:
    row = dataset.rows[index]
    return NamedCloud(row["sample_id"], dataset.cloud(index), dataset.parts(index), row["state"])


def _of_simulation(row: dict[str, str]) -> NamedCloud:
    frame = replay(unflatten(row))
    return NamedCloud(row["sample_id"], frame.points, frame.cut.part.reshape(-1), row["state"])


def _written(folder: Path) -> dict[Path, tuple[int, int]]:
    """Size and time of each cloud file in a folder, in its order; nothing where there is none."""
    try:
        stats = [(path, path.stat()) for path in find_clouds([folder])]
    except (CloudReadError, OSError):  # empty, not there, or a file that went while we looked
        return {}
    return {path: (stat.st_size, stat.st_mtime_ns) for path, stat in stats}
