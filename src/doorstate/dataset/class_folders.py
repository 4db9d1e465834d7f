# SPDX-License-Identifier: Apache-2.0
"""Labelled clouds in one folder per state, in any usual spelling, with an optional CSV of poses."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from doorstate.dataset.poses import read_poses
from doorstate.errors import DatasetError
from doorstate.io.find import find_clouds
from doorstate.types import NO_DOOR, DoorState

# Order matters: "semi-open" and "half closed" contain the other words too.
_SPELLINGS = (
    (DoorState.SEMI_OPEN, re.compile(r"semi|half|yari|ajar|part(ly|ial)|aralik")),
    (DoorState.CLOSED, re.compile(r"clos|shut|kapali")),
    (DoorState.OPEN, re.compile(r"open|acik")),
)
_WORDS = re.compile(
    r"(semi|half|yari|ajar|partly|partially|partial|opened|open|closed|close|shut|doors?|is|the|aralik|kapali|acik)+"
)
_NO_DOOR = re.compile(r"none|(no|without)(an?y?)?(clear)?doors?")
Label = TypeVar("Label")


def state_of_folder(name: str) -> DoorState | None:
    """Return the state in a folder's name, or None: `Semi-Open`, `semiopen_doors`, `01_closed`, `half open`."""
    letters = re.sub(r"[^a-z]", "", name.lower())
    if not _WORDS.fullmatch(letters):
        return None
    return next((state for state, spelling in _SPELLINGS if spelling.search(letters)), None)


def label_of_folder(name: str) -> str | None:
    """Return the label in a folder's name: a state, `no_door` (`none`, `no door`, `without_doors`), or None."""
    state = state_of_folder(name)
    if state is not None:
        return str(state)
    return NO_DOOR if _NO_DOOR.fullmatch(re.sub(r"[^a-z]", "", name.lower())) else None


def nearest_label(root: Path, path: Path, label_of: Callable[[str], Label | None]) -> Label | None:
    """Return the label of the nearest folder above a file that has one, up to and including `root`."""
    names = (root.name, *path.relative_to(root).parts[:-1])
    return next((label for name in reversed(names) if (label := label_of(name)) is not None), None)


def file_row(root: Path, path: Path, label: str) -> dict[str, str]:
    """Return the manifest row of a file below `root`."""
    relative = path.relative_to(root)
    return {
        "sample_id": relative.with_suffix("").as_posix(),
        "state": label,
        "file": relative.as_posix(),
    }


def labelled_rows(root: Path, poses_csv: Path | None = None) -> list[dict[str, str]]:
    """Return one manifest row for every cloud in a class folder, with pose and strata if the CSV has them.

    Every file with a suffix of a cloud format counts; a `notes.txt` is rejected when it is read.

    Args:
        root: folder whose sub-folders, at any depth, are named after the states; the nearest one decides.
        poses_csv: file of poses (`dataset.poses`).

    Raises:
        CloudReadError: no cloud at all.
        DatasetError: no class folder, or the CSV is invalid or names files that do not exist.
    """
    if not root.is_dir():
        raise DatasetError("is not a folder", path=root)
    poses = read_poses(poses_csv) if poses_csv else {}
    rows, unused = [], set(poses)
    for path in find_clouds([root]):
        state = nearest_label(root, path, state_of_folder)
        if state is None:
            continue
        row = file_row(root, path, state)
        relative = path.relative_to(root)
        key = next((name for name in (relative.as_posix(), relative.name) if name in poses), None)
        if key:
            row |= poses[key]
            unused.discard(key)
        rows.append(row)
    if not rows:
        raise DatasetError(
            "no clouds in folders named after the states",
            path=root,
            expected="folders such as open, semi-open, closed",
        )
    if unused:
        raise DatasetError(
            f"{len(unused)} files are not in {root}, such as {sorted(unused)[0]!r}",
            path=poses_csv,
            field="file",
        )
    _disambiguate(rows)
    return rows


def _disambiguate(rows: list[dict[str, str]]) -> None:
    # `door.pcd` and `door.ply` side by side are two samples.
    uses = Counter(row["sample_id"] for row in rows)
    for row in rows:
        if uses[row["sample_id"]] > 1:
            row["sample_id"] = row["file"]
