# SPDX-License-Identifier: Apache-2.0
"""`digests.json`: contents that a run or a comparison began with, compared when it goes on, ends and is reported.

Folders of version 0.1 have no such file: they get one of the contents at hand when they are continued.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from doorstate._documents import read_json
from doorstate.dataset.digests import dataset_digests, file_digest, roles_digest
from doorstate.dataset.roles import Role
from doorstate.errors import RunError
from doorstate.training.run_folder import write_json

DIGESTS = "digests.json"
_SPLITS, _START = "splits", "weights to start from"


def contents_of_run(
    dataset: Path,
    roles: Mapping[str, Role],
    extra_datasets: Iterable[Path] = (),
    start_from: str | None = None,
) -> dict[str, str]:
    """Return the digests of everything that a run reads, by name.

    Raises:
        DatasetError: a file cannot be read.
    """
    contents = _of_datasets(dataset, extra_datasets) | {_SPLITS: roles_digest(roles)}
    if start_from is not None and Path(start_from).is_file():  # a missing one is refused where it is read
        contents[_START] = file_digest(Path(start_from))
    return contents


def contents_of_comparison(
    dataset: Path, splits: Sequence[Mapping[str, Role]], extra_datasets: Iterable[Path] = ()
) -> dict[str, str]:
    """Return the digests of everything that all runs of a comparison read, by name.

    Raises:
        DatasetError: a file cannot be read.
    """
    folds = {f"{_SPLITS} {fold}": roles_digest(roles) for fold, roles in enumerate(splits)}
    return _of_datasets(dataset, extra_datasets) | folds


def keep_contents(folder: Path, contents: Mapping[str, str]) -> None:
    """Write `digests.json` of a folder, or compare what the folder began with.

    Raises:
        RunError: a content has changed.
    """
    check_contents(folder, contents)
    path = folder / DIGESTS
    if not path.is_file():
        write_json(path, contents)


def check_contents(folder: Path, contents: Mapping[str, str]) -> None:
    """Compare contents with those that a folder began with, as far as both are known.

    Raises:
        RunError: a content has changed, or `digests.json` is damaged.
    """
    path = folder / DIGESTS
    if not path.is_file():
        return
    began_with = read_json(path)
    changed = [name for name in contents if began_with.get(name, contents[name]) != contents[name]]
    if changed:
        raise RunError(
            f"began with another content of {', '.join(changed)}",
            path=folder,
            field=changed[0],
            hint="restore what it began with, or choose another folder",
        )


def _of_datasets(dataset: Path, extra_datasets: Iterable[Path]) -> dict[str, str]:
    digests = dataset_digests(dataset)
    for number, folder in enumerate(extra_datasets, 1):
        digests |= {
            f"additional data {number}: {name}": value for name, value in dataset_digests(folder).items()
        }
    return digests
