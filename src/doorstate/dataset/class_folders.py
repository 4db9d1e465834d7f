# SPDX-License-Identifier: Apache-2.0
"""Labelled clouds as people keep them: one folder per state, in any usual spelling, with an optional CSV of poses."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from doorstate._files import read_csv
from doorstate.dataset.strata import distance_band, polar, region
from doorstate.errors import DatasetError
from doorstate.io.find import find_clouds
from doorstate.types import NO_DOOR, DoorState

# Order matters: "semi-open" and "half closed" hold the other words too.
_SPELLINGS = (
    (DoorState.SEMI_OPEN, re.compile(r"semi|half|yari|ajar|part(ly|ial)|aralik")),
    (DoorState.CLOSED, re.compile(r"clos|shut|kapali")),
    (DoorState.OPEN, re.compile(r"open|acik")),
)
_WORDS = re.compile(
    r"(semi|half|yari|ajar|partly|partially|partial|opened|open|closed|close|shut|doors?|is|the|aralik|kapali|acik)+"
)
_UNITS = ("_m", "_deg", "_px", "_share")
_NO_DOOR = re.compile(r"none|(no|without)(an?y?)?(clear)?doors?")
Meaning = TypeVar("Meaning")


def state_of_folder(name: str) -> DoorState | None:
    """The state a folder's name spells, or None: `Semi-Open`, `semiopen_doors`, `01_closed`, `half open` all work."""
    letters = re.sub(r"[^a-z]", "", name.lower())
    if not _WORDS.fullmatch(letters):
        return None
    return next((state for state, spelling in _SPELLINGS if spelling.search(letters)), None)


def label_of_folder(name: str) -> str | None:
    """As `state_of_folder`, and `no_door` of a name such as `none`, `no door` or `without_doors`."""
    state = state_of_folder(name)
    if state is not None:
        return state.label
    return NO_DOOR if _NO_DOOR.fullmatch(re.sub(r"[^a-z]", "", name.lower())) else None


def nearest(root: Path, path: Path, means: Callable[[str], Meaning | None]) -> Meaning | None:
    """What the nearest folder of a file means that means anything, up to `root` itself."""
    names = (root.name, *path.relative_to(root).parts[:-1])
    return next((found for name in reversed(names) if (found := means(name)) is not None), None)


def row_of(root: Path, path: Path, label: str) -> dict[str, str]:
    """Manifest row of a file below `root`."""
    relative = path.relative_to(root)
    return {
        "sample_id": relative.with_suffix("").as_posix(),
        "state": label,
        "file": relative.as_posix(),
    }


def labelled_rows(root: Path, poses_csv: Path | None = None) -> list[dict[str, str]]:
    """One manifest row for every cloud under a class folder, with strata where its pose is known.

    Whatever has a cloud's suffix there is taken for a cloud: a `notes.txt` is left out with its reason when it is read.

    Args:
        root: folder whose sub-folders, at any depth, are named after the states; the nearest one decides.
        poses_csv: columns `file` (path below root, or the bare name) and either `x_m,y_m` (door frame) or
            `distance_m,robot_angle_deg`; further columns are kept.

    Raises:
        CloudReadError: no cloud at all.
        DatasetError: no class folder, or the CSV lacks a column or names a file twice.
    """
    if not root.is_dir():
        raise DatasetError(f"{root}: is not a folder")
    poses = _read_poses(poses_csv) if poses_csv else {}
    rows, unused = [], set(poses)
    for path in find_clouds([root]):
        state = nearest(root, path, state_of_folder)
        if state is None:
            continue
        row = row_of(root, path, state.label)
        relative = path.relative_to(root)
        key = next((k for k in (relative.as_posix(), relative.name) if k in poses), None)
        if key:
            row |= poses[key]
            unused.discard(key)
        rows.append(row)
    if not rows:
        raise DatasetError(
            f"{root}: no clouds in folders named after the states (such as open, semi-open, closed)"
        )
    if unused:
        raise DatasetError(
            f"{poses_csv}: {len(unused)} files are not in {root}, such as {sorted(unused)[0]!r}"
        )
    _disambiguate(rows)
    return rows


def _disambiguate(rows: list[dict[str, str]]) -> None:
    # `door.pcd` and `door.ply` side by side are two samples.
    uses = Counter(row["sample_id"] for row in rows)
    for row in rows:
        if uses[row["sample_id"]] > 1:
            row["sample_id"] = row["file"]


def _read_poses(path: Path) -> dict[str, dict[str, str]]:
    poses: dict[str, dict[str, str]] = {}
    for number, row in enumerate(read_csv(path), start=2):
        name = row.pop("file", None)
        if not name:
            raise DatasetError(f"{path}: line {number} has no value in column 'file'")
        if name in poses:
            raise DatasetError(f"{path}: line {number} names {name!r} a second time")
        for reserved in ("sample_id", "state"):
            row.pop(reserved, None)
        _check_quantities(row, f"{path}: line {number}")
        poses[name] = row | _strata(row, f"{path}: line {number}")
    return poses


def _check_quantities(row: dict[str, str], where: str) -> None:
    """Raise DatasetError for text under a name that ends in a unit: reports and heads count on numbers there."""
    for name, value in row.items():
        try:
            if value and name.endswith(_UNITS) and not math.isfinite(float(value)):
                raise ValueError
        except ValueError as error:
            raise DatasetError(f"{where}: {name} is {value!r}, not a number") from error


def _strata(row: dict[str, str], where: str) -> dict[str, str]:
    if row.get("x_m") and row.get("y_m"):
        distance_m, angle_deg = polar(float(row["x_m"]), float(row["y_m"]))
        pose_id = row.get("pose_id") or f"{float(row['x_m']):.3f},{float(row['y_m']):.3f}"
    elif row.get("distance_m") and row.get("robot_angle_deg"):
        distance_m, angle_deg = float(row["distance_m"]), float(row["robot_angle_deg"])
        pose_id = row.get("pose_id") or f"{distance_m:.3f},{angle_deg:.3f}"
    else:
        raise DatasetError(f"{where}: needs x_m and y_m, or distance_m and robot_angle_deg")
    return {
        "pose_id": pose_id,
        "distance_m": str(distance_m),
        "robot_angle_deg": str(angle_deg),
        "distance_band": distance_band(distance_m),
        "region": region(angle_deg),
    }
