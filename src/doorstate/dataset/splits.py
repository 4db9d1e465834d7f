# SPDX-License-Identifier: Apache-2.0
"""Five folds of 70 % training, 10 % validation and 20 % test, drawn once and saved to a file.

- `paper`: stratified by state, distance band and angle region, random within strata. The same pose in another state,
  and poses 10 cm away, may be on both sides, as in the paper.
- `by-pose`: blocks of neighbouring poses are tested, with an embargo of 0.5 m around them (`pose_blocks`).
- `by-scene`: all samples of a scene stay on one side; stratified by kind, distance band and region.
- `all`: one "fold" that trains on every sample, for final weights of a chosen recipe.
- `unseen`: one "fold" that tests every sample, for weights that were trained on other data.
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from doorstate._files import read_csv, write_csv
from doorstate.dataset.crops import ADDED
from doorstate.dataset.pose_blocks import split_poses
from doorstate.dataset.roles import ROLES, Role
from doorstate.errors import DatasetError, unknown_name

Strata = Sequence[tuple[str, ...]]
EVERYTHING, UNSEEN = "all", "unseen"
ONE_FOLD: Mapping[str, Role] = {EVERYTHING: "train", UNSEEN: "test"}
PROTOCOLS = ("paper", "by-pose", "by-scene", *ONE_FOLD)
NUM_FOLDS = 5
_TENTHS = 10
_LEAST_SAMPLES = 3 * _TENTHS


def draw_splits(rows: Sequence[Mapping[str, str]], protocol: str, seed: int) -> list[dict[str, Role]]:
    """Draw the role of every sample in every fold.

    Returns:
        One {sample_id: role} per fold; every sample is tested in exactly one fold, under `all` in none.

    Raises:
        ConfigError: no such protocol.
        DatasetError: the rows lack poses or scenes that the protocol needs, or there are too few samples.
    """
    if len(rows) < _LEAST_SAMPLES:
        raise DatasetError(
            f"{len(rows)} samples are too few for {NUM_FOLDS} folds", expected=f"at least {_LEAST_SAMPLES}"
        )
    if protocol not in PROTOCOLS:
        raise unknown_name("protocol", protocol, PROTOCOLS, field="protocol")
    if protocol in ONE_FOLD:
        return [dict.fromkeys((row["sample_id"] for row in rows), ONE_FOLD[protocol])]
    if protocol == "by-pose":
        splits = split_poses(rows, NUM_FOLDS, seed)
    else:
        splits = (_by_scene if protocol == "by-scene" else _by_stratum)(rows, seed)
    # Doors that the finder missed are for training only: a predictor would not crop them.
    added = [row["sample_id"] for row in rows if row.get("candidate") == ADDED]
    for roles in splits:
        roles |= {sample: "unused" for sample in added if roles[sample] != "train"}
    for fold, roles in enumerate(splits):
        for role in ("train", "val", "test"):
            if role not in roles.values():
                raise DatasetError(
                    f"{len(rows)} samples are too few for protocol {protocol}: fold {fold} has none to {role}"
                )
    return splits


def origin(row: Mapping[str, str]) -> str:
    """Return the origin that trained and tested samples must not share: the scene, else seed and name."""
    return row.get("scene_id") or f"{row.get('seed', '')}/{row.get('frame_id') or row['sample_id']}"


def _by_stratum(rows: Sequence[Mapping[str, str]], seed: int) -> list[dict[str, Role]]:
    strata = [(row["state"], row.get("distance_band", ""), row.get("region", "")) for row in rows]
    return _roles(rows, _tenths(strata, seed))


def _by_scene(rows: Sequence[Mapping[str, str]], seed: int) -> list[dict[str, Role]]:
    scenes: dict[str, tuple[str, ...]] = {}
    for row in rows:
        if not row.get("scene_id"):
            raise DatasetError(
                f"protocol by-scene needs the scene of every sample, and {row['sample_id']} has none",
                field="scene_id",
                hint="simulate a preset of many scenes",
            )
        kind = row.get("door_kind") or row.get("scene_kind", "")
        scenes[row["scene_id"]] = (kind, row.get("distance_band", ""), row.get("region", ""))
    # Scenes are the units, so no groups are needed: StratifiedGroupKFold balances samples, not scenes.
    tenth = dict(zip(scenes, _tenths(list(scenes.values()), seed), strict=True))
    return _roles(rows, [tenth[row["scene_id"]] for row in rows])


def _roles(
    rows: Sequence[Mapping[str, str]], tenths: Sequence[int] | NDArray[np.int64]
) -> list[dict[str, Role]]:
    """Return roles in every fold: two tenths of the samples are tested, one validates."""
    roles: list[dict[str, Role]] = []
    for fold in range(NUM_FOLDS):
        test = {2 * fold, 2 * fold + 1}
        val = (2 * fold + 2) % _TENTHS
        roles.append(
            {
                row["sample_id"]: "test" if part in test else "val" if part == val else "train"
                for row, part in zip(rows, tenths, strict=True)
            }
        )
    return roles


def _tenths(strata: Strata, seed: int) -> NDArray[np.int64]:
    """Return a number from 0 to 9 for each sample; tenths differ by one sample at most, in total and per stratum."""
    from sklearn.model_selection import StratifiedKFold  # slow to import

    # StratifiedKFold needs a stratum of ten samples: small data sets are stratified by the first name alone, or not.
    for depth in (3, 1, 0):
        labels = np.array(["|".join(stratum[:depth]) for stratum in strata])
        if max(Counter(labels.tolist()).values()) >= _TENTHS:
            break
    else:
        raise DatasetError(f"{len(strata)} scenes are too few", expected=f"at least {_TENTHS}")
    tenth = np.empty(len(strata), dtype=np.int64)
    folds = StratifiedKFold(_TENTHS, shuffle=True, random_state=seed % 2**32)
    with warnings.catch_warnings():
        # Strata of fewer than ten samples are spread over some of the tenths, which is as even as possible.
        warnings.filterwarnings("ignore", "The least populated class", UserWarning)
        for number, (_, members) in enumerate(folds.split(labels, labels)):
            tenth[members] = number
    return tenth


def write_splits(path: Path, splits: Sequence[Mapping[str, Role]]) -> None:
    """Write `sample_id,fold_0,...`."""
    write_csv(
        path,
        [
            {"sample_id": sample} | {f"fold_{fold}": roles[sample] for fold, roles in enumerate(splits)}
            for sample in splits[0]
        ],
    )


def read_splits(path: Path) -> list[dict[str, Role]]:
    """Read a file of `write_splits`.

    Raises:
        DatasetError: the file has another form.
    """
    rows = read_csv(path)
    if not rows or "sample_id" not in rows[0] or "fold_0" not in rows[0]:
        raise DatasetError("is not a file of splits", path=path, expected="columns sample_id, fold_0, ...")
    splits: list[dict[str, Role]] = []
    for fold in range(len(rows[0]) - 1):
        roles: dict[str, Role] = {}
        for row in rows:
            role = row.get(f"fold_{fold}")
            if role not in ROLES:
                raise DatasetError(
                    f"{row['sample_id']} has role {role!r}",
                    path=path,
                    field=f"fold_{fold}",
                    expected=f"one of {', '.join(ROLES)}",
                )
            roles[row["sample_id"]] = role
        splits.append(roles)
    return splits
