# SPDX-License-Identifier: Apache-2.0
"""Digests of data sets and splits: what a run began with is what it ends with, whatever the folder is called.

`dataset.json` is left out: it names the version that wrote it, and the other files hold the data.
"""

from __future__ import annotations

import gzip
import hashlib
import json
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

from doorstate.dataset.roles import Role
from doorstate.dataset.store import CLOUDS_FILE, PARTS_FILE, manifest_path
from doorstate.errors import DatasetError
from doorstate.simulation.manifest import MANIFEST_FILE


def dataset_digests(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of each file of a data set that is there, by name; of a compressed manifest, as unpacked.

    Raises:
        DatasetError: there is no manifest, or a file cannot be read.
    """
    files = {MANIFEST_FILE: manifest_path(folder)}
    files |= {name: path for name in (CLOUDS_FILE, PARTS_FILE) if (path := folder / name).is_file()}
    return {name: file_digest(path) for name, path in files.items()}


def file_digest(path: Path) -> str:
    """Return the SHA-256 of a file, unpacked if its name ends in `.gz`.

    Raises:
        DatasetError: the file cannot be read.
    """
    try:
        status = path.stat()
        return _digest(path.absolute(), status.st_ino, status.st_size, status.st_mtime_ns)
    except (OSError, EOFError) as error:
        raise DatasetError(f"cannot be read ({error})", path=path) from error


# A study has many runs of one data set, and reading it takes a second per gigabyte.
@lru_cache(maxsize=64)
def _digest(path: Path, inode: int, size: int, modified_ns: int) -> str:
    with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def roles_digest(roles: Mapping[str, Role]) -> str:
    """Return the SHA-256 of the roles of a fold, whose order does not matter."""
    return hashlib.sha256(json.dumps(sorted(roles.items())).encode()).hexdigest()
