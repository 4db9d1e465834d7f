# SPDX-License-Identifier: Apache-2.0
"""Cloud files in folders."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from doorstate.errors import CloudReadError
from doorstate.io.formats import BAG_SUFFIXES, CLOUD_SUFFIXES, OPEN_BAG_HINT, format_suffix

_PREPARED = "dataset.json"  # dataset.store
INDEX_FILE = "index.csv"  # dataset.frame_index
_TABLES = (INDEX_FILE, "manifest.csv", "predictions.csv", "rejected.csv")


def find_clouds(paths: Sequence[Path]) -> list[Path]:
    """List the cloud files among files and in folders.

    Folders are searched recursively. Hidden files, colour images beside depth images (`*_rgb.png`) and tables about
    clouds (`index.csv`, `manifest.csv`, `predictions.csv`, `rejected.csv`) are skipped.

    Returns:
        Paths in the order of the arguments; those of one folder in natural order (2 before 10).

    Raises:
        CloudReadError: a path does not exist, or a folder holds no cloud.
    """
    files: list[Path] = []
    for path in paths:
        if path.is_dir():
            files += _clouds_of(path)
        elif path.exists():
            files.append(path)
        else:
            raise CloudReadError("no such file or folder", path=path)
    return files


def _clouds_of(folder: Path) -> list[Path]:
    if (folder / _PREPARED).is_file():
        raise CloudReadError("is a prepared data set, not a folder of cloud files", path=folder)
    members = [member for member in folder.rglob("*") if member.is_file()]
    clouds = [member for member in members if _is_cloud(member.relative_to(folder))]
    if not clouds:
        has_bag = any(member.suffix in BAG_SUFFIXES for member in members)
        raise CloudReadError(
            "no clouds in this folder",
            path=folder,
            expected=" ".join(CLOUD_SUFFIXES),
            hint=OPEN_BAG_HINT if has_bag else None,
        )
    return sorted(clouds, key=_natural_order)


def _is_cloud(path: Path) -> bool:
    hidden = any(part.startswith(".") for part in path.parts)
    skipped = path.name in _TABLES or path.name.lower().endswith("_rgb.png")
    return format_suffix(path) in CLOUD_SUFFIXES and not hidden and not skipped


def _natural_order(path: Path) -> tuple[list[str | int], str]:
    pieces = re.split(r"(\d+)", str(path).lower())
    return [int(piece) if place % 2 else piece for place, piece in enumerate(pieces)], str(path)
