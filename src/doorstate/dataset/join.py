# SPDX-License-Identifier: Apache-2.0
"""Several prepared data sets as one: what weights for the real world are trained on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from doorstate import __version__
from doorstate._files import atomic_path, is_vacant, write_csv
from doorstate.dataset.store import (
    CLOUDS,
    MANIFEST,
    PARTS,
    DatasetDescription,
    PreparedDataset,
    open_dataset,
)
from doorstate.errors import ConfigError, DatasetError

_BESIDE = " + "  # between the sources of a joined data set, each named once


def join_datasets(sources: Sequence[Path], folder: Path) -> PreparedDataset:
    """Write the samples of prepared data sets behind one another; parts of points if all of them know theirs.

    What a killed join left behind is written anew.

    Raises:
        ConfigError: the folder is not empty, or the data sets have clouds of different sizes.
        DatasetError: one cannot be opened, or two hold a sample of the same name.
    """
    if not (is_vacant(folder) or _is_begun(folder)):
        raise ConfigError(f"{folder}: exists and holds something; choose another folder")
    datasets = [open_dataset(source) for source in sources]
    num_points = datasets[0].num_points
    for source, dataset in zip(sources, datasets, strict=True):
        if dataset.num_points != num_points:
            raise ConfigError(
                f"{source}: has {dataset.num_points} points a cloud, {sources[0]} has {num_points}; prepare one anew"
            )
        check_thinned_alike(dataset, datasets[0])
    rows = [row for dataset in datasets for row in dataset.rows]
    name, count = Counter(row["sample_id"] for row in rows).most_common(1)[0]
    if count > 1:
        raise DatasetError(
            f"sample {name!r} is there {count} times; data sets that share names cannot be joined"
        )
    folder.mkdir(parents=True, exist_ok=True)
    _stack(folder / CLOUDS, [dataset.clouds for dataset in datasets])
    if all(dataset.knows_parts for dataset in datasets):
        every = [dataset.parts_of(np.arange(len(dataset)), num_points) for dataset in datasets]
        _stack(folder / PARTS, every)
    write_csv(folder / MANIFEST, rows)
    parts = [dataset.description.source for dataset in datasets]
    limits_m = [dataset.description.max_depth_m for dataset in datasets]
    kinds = {dataset.description.kind for dataset in datasets}
    DatasetDescription(
        kind="simulated" if kinds == {"simulated"} else "imported",
        source=_BESIDE.join(dict.fromkeys(each for part in parts for each in part.split(_BESIDE))),
        num_points=num_points,
        samples=len(rows),
        max_depth_m=None if None in limits_m else max(limit_m for limit_m in limits_m if limit_m),
        thin=datasets[0].description.thin,
        doorstate_version=__version__,
    ).save(folder)
    return open_dataset(folder)


def check_thinned_alike(one: PreparedDataset, other: PreparedDataset) -> None:
    """Raise ConfigError for data sets that must not be learned together: only one was sampled as a predictor does."""
    if one.description.thin != other.description.thin:
        raise ConfigError(f"{one.folder} and {other.folder}: one was prepared with --thin; prepare one anew")


def _is_begun(folder: Path) -> bool:
    """Whether a join was killed here, after its clouds were written and before its description was."""
    names = {path.name for path in folder.iterdir() if ".tmp." not in path.name} if folder.is_dir() else set()
    return CLOUDS in names and names <= {CLOUDS, PARTS, MANIFEST}


def _stack(target: Path, arrays: Sequence[np.ndarray]) -> None:
    shape = (sum(len(array) for array in arrays), *arrays[0].shape[1:])
    with atomic_path(target) as temporary:
        whole = np.lib.format.open_memmap(temporary, mode="w+", dtype=arrays[0].dtype, shape=shape)
        np.concatenate(arrays, out=whole)
        whole.flush()
        del whole
