# SPDX-License-Identifier: Apache-2.0
"""Concatenation of prepared data sets."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from doorstate import __version__
from doorstate._files import is_scratch, is_vacant, write_csv
from doorstate._locks import owned_folder
from doorstate.dataset.description import DatasetDescription
from doorstate.dataset.pieces import write_concatenated
from doorstate.dataset.store import CLOUDS_FILE, PARTS_FILE, PreparedDataset, open_dataset
from doorstate.errors import ConfigError, DatasetError
from doorstate.simulation.manifest import MANIFEST_FILE

_SEPARATOR = " + "  # between the sources of a joined data set


def join_datasets(sources: Sequence[Path], folder: Path) -> PreparedDataset:
    """Write the samples of prepared data sets one after another, with parts of points if all data sets have them.

    Files of a killed join are overwritten.

    Raises:
        ConfigError: the folder is not empty, or the clouds differ in size or sampling.
        DatasetError: a data set cannot be opened, or two have a sample of the same name.
        FolderInUseError: another process works in the folder.
    """
    with owned_folder(folder):
        return _join(sources, folder)


def _join(sources: Sequence[Path], folder: Path) -> PreparedDataset:
    if not (is_vacant(folder) or _is_unfinished(folder)):
        raise ConfigError("exists and is not empty", path=folder, hint="choose another folder")
    datasets = [open_dataset(source) for source in sources]
    num_points = datasets[0].num_points
    for source, dataset in zip(sources, datasets, strict=True):
        if dataset.num_points != num_points:
            raise ConfigError(
                f"has clouds of {dataset.num_points} points",
                path=source,
                expected=f"{num_points} as in {sources[0]}",
            )
        check_same_sampling(dataset, datasets[0])
    rows = [row for dataset in datasets for row in dataset.rows]
    name, count = Counter(row["sample_id"] for row in rows).most_common(1)[0]
    if count > 1:
        raise DatasetError(f"{count} samples are named {name!r}", field="sample_id")
    folder.mkdir(parents=True, exist_ok=True)
    clouds = (dataset.clouds for dataset in datasets)
    write_concatenated(folder / CLOUDS_FILE, clouds, (len(rows), num_points, 3), np.float32)
    if all(dataset.has_parts for dataset in datasets):
        parts = (dataset.parts_of(np.arange(len(dataset)), num_points) for dataset in datasets)
        write_concatenated(folder / PARTS_FILE, parts, (len(rows), num_points), np.uint8)
    write_csv(folder / MANIFEST_FILE, rows)
    names = [name for dataset in datasets for name in dataset.description.source.split(_SEPARATOR)]
    limits_m = [dataset.description.max_depth_m for dataset in datasets]
    kinds = {dataset.description.kind for dataset in datasets}
    DatasetDescription(
        kind="simulated" if kinds == {"simulated"} else "imported",
        source=_SEPARATOR.join(dict.fromkeys(names)),
        num_points=num_points,
        samples=len(rows),
        max_depth_m=None if None in limits_m else max(limit_m for limit_m in limits_m if limit_m),
        thin=datasets[0].description.thin,
        remove_outliers=datasets[0].description.remove_outliers,
        crops=datasets[0].description.crops,
        left_out=dict(sum((Counter(dataset.description.left_out) for dataset in datasets), Counter())),
        doorstate_version=__version__,
    ).save(folder)
    return open_dataset(folder)


def check_same_sampling(dataset: PreparedDataset, reference: PreparedDataset) -> None:
    """Raise ConfigError if only one data set was thinned, or cleaned of outliers, before sampling."""
    for name in ("input", "thin", "remove_outliers"):
        value, expected = (getattr(each.description, name) for each in (dataset, reference))
        if value != expected:
            raise ConfigError(
                f"{name} is {value}",
                path=dataset.folder,
                expected=f"{expected} as in {reference.folder}",
                hint="prepare the data sets with the same settings",
            )


def _is_unfinished(folder: Path) -> bool:
    """Return True for the files of a join that was killed before it wrote its description."""
    names = {path.name for path in folder.iterdir() if not is_scratch(path)} if folder.is_dir() else set()
    return CLOUDS_FILE in names and names <= {CLOUDS_FILE, PARTS_FILE, MANIFEST_FILE}
