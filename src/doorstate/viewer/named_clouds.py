# SPDX-License-Identifier: Apache-2.0
"""Clouds to show, from files, prepared data sets and simulated folders."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate._files import read_csv
from doorstate.dataset.frame_index import IndexedOptions
from doorstate.dataset.store import PreparedDataset, is_prepared, open_dataset
from doorstate.errors import DatasetError, DoorstateError
from doorstate.io.find import find_clouds
from doorstate.io.options import DEFAULT_OPTIONS, ReadOptions
from doorstate.io.readers import read_posed_cloud
from doorstate.io.sensor_pose import SensorPose
from doorstate.simulation.frames import replay
from doorstate.simulation.manifest import MANIFEST_FILE, unflatten
from doorstate.simulation.writer import is_simulated
from doorstate.types import Points


class NamedCloud(NamedTuple):
    """Cloud with its name, and with parts and true state where these are known."""

    name: str
    cloud: Points | DoorstateError  # input of a `Predictor`, or the reason why there is none
    parts: NDArray[np.uint8] | None = None  # (N,) part of each point of the flattened cloud
    truth: str = ""  # true state
    pose: SensorPose | None = None  # that was applied to the points of a file or message


def find_named_clouds(
    paths: Sequence[Path], options: ReadOptions = DEFAULT_OPTIONS
) -> list[Callable[[], NamedCloud]]:
    """Return one function for each cloud, which reads it.

    Args:
        paths: files, folders of files, prepared data sets and simulated folders.
        options: how files are read that no `index.csv` describes.

    Raises:
        CloudReadError: a path does not exist, or a folder holds no cloud.
        DatasetError: a data set cannot be used.
    """
    readers: list[Callable[[], NamedCloud]] = []
    files: list[Path] = []
    for path in paths:
        if is_prepared(path):
            dataset = open_dataset(path)
            readers += [partial(_read_sample, dataset, index) for index in range(len(dataset))]
        elif is_simulated(path):
            if not (path / MANIFEST_FILE).is_file():
                raise DatasetError("the simulation is not complete", path=path)
            readers += [partial(_replay_row, row) for row in read_csv(path / MANIFEST_FILE)]
        else:
            files += find_clouds([path])
    parent = os.path.commonpath([file.absolute().parent for file in files]) if files else ""
    indexed = IndexedOptions(options)
    return readers + [partial(read_named_cloud, file, Path(parent), indexed) for file in files]


def read_named_cloud(path: Path, folder: Path, options: IndexedOptions) -> NamedCloud:
    """Read a file; its name is the path relative to an absolute folder."""
    name = path.absolute().relative_to(folder).as_posix()
    try:
        cloud, pose = read_posed_cloud(path, options.of(path))
        return NamedCloud(name, cloud, pose=pose)
    except DoorstateError as error:
        return NamedCloud(name, error)


def _read_sample(dataset: PreparedDataset, index: int) -> NamedCloud:
    row = dataset.rows[index]
    return NamedCloud(row["sample_id"], dataset.cloud(index), dataset.parts(index), row["state"])


def _replay_row(row: dict[str, str]) -> NamedCloud:
    frame = replay(unflatten(row))
    return NamedCloud(row["sample_id"], frame.points, frame.cut.part.reshape(-1), row["state"])
