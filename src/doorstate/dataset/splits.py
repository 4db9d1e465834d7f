# SPDX-License-Identifier: Apache-2.0
"""Five folds of 70 % training, 10 % validation and 20 % test, drawn once, written to a file and never drawn again.

`paper`: stratified by state x distance band x angle region, random within. The same pose in another state, and poses
10 cm away, may be on both sides: that is the paper's way.

`by-pose`: the half-ring is cut into five sectors of bearing and two rings of distance; a fold tests the inner block of
one sector and the outer block of another. All states of a pose stay together, and poses within 0.5 m of a tested one
are used by nobody in that fold.

`by-scene`: whole scenes, which is a door in its room and all that was seen of it, stay on one side; dealt by what they
show and from where.

`all`: one "fold" that trains on every sample and tests none, for weights to be used once a recipe has been chosen.

`unseen`: one "fold" that tests every sample and trains on none, for weights that were trained on something else.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from doorstate._files import read_csv, write_csv
from doorstate.errors import ConfigError, DatasetError

Role = Literal["train", "val", "test", "unused"]
Row = Mapping[str, str]
EVERYTHING, UNSEEN = "all", "unseen"
ONE_FOLD: Mapping[str, Role] = {EVERYTHING: "train", UNSEEN: "test"}
PROTOCOLS = ("paper", "by-pose", "by-scene", *ONE_FOLD)
NUM_FOLDS = 5
EMBARGO_M = 0.5
_TENTHS = 10


def draw_splits(rows: Sequence[Row], protocol: str, seed: int) -> list[dict[str, Role]]:
    """Role of every sample in every fold.

    Returns:
        One {sample_id: role} per fold; every sample is tested in exactly one fold, under `all` in none.

    Raises:
        ConfigError: no such protocol.
        DatasetError: the protocol needs poses that the data set does not have, or there are too few samples.
    """
    if len(rows) < _TENTHS * 3:
        raise DatasetError(
            f"{len(rows)} samples are too few for {NUM_FOLDS} folds: at least {_TENTHS * 3} are needed"
        )
    if protocol not in PROTOCOLS:
        raise ConfigError(f"no protocol {protocol!r}: choose one of {', '.join(PROTOCOLS)}")
    if protocol in ONE_FOLD:
        return [dict.fromkeys((row["sample_id"] for row in rows), ONE_FOLD[protocol])]
    splits = {"paper": _paper, "by-pose": _by_pose, "by-scene": _by_scene}[protocol](rows, seed)
    for fold, roles in enumerate(splits):
        for role in ("train", "val", "test"):
            if role not in roles.values():
                raise DatasetError(
                    f"{len(rows)} samples are too few for protocol {protocol}: nothing is left to {role} in fold {fold}"
                )
    return splits


def origin(row: Row) -> str:
    """What a learned and a tested sample may not share: the scene, whatever sensor saw it; else seed and name."""
    return row.get("scene_id") or f"{row.get('seed', '')}/{row['sample_id']}"


def _paper(rows: Sequence[Row], seed: int) -> list[dict[str, Role]]:
    tenths = _deal(
        [(row["state"], row.get("distance_band", ""), row.get("region", "")) for row in rows], seed
    )
    return _roles(rows, tenths)


def _by_scene(rows: Sequence[Row], seed: int) -> list[dict[str, Role]]:
    scenes: dict[str, tuple[str, ...]] = {}
    for row in rows:
        if not row.get("scene_id"):
            raise DatasetError(
                f"protocol by-scene needs the scene of every sample; {row['sample_id']} has none "
                "(simulate a preset of many scenes)"
            )
        kind = row.get("door_kind") or row.get("scene_kind", "")
        scenes[row["scene_id"]] = (kind, row.get("distance_band", ""), row.get("region", ""))
    tenth = dict(zip(scenes, _deal(list(scenes.values()), seed), strict=True))
    return _roles(rows, [tenth[row["scene_id"]] for row in rows])


def _roles(rows: Sequence[Row], tenths: Sequence[int]) -> list[dict[str, Role]]:
    """Roles in every fold of samples that were dealt into tenths: two are tested, one validates."""
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


def _deal(strata: Sequence[tuple[str, ...]], seed: int) -> list[int]:
    """Deal samples into tenths like cards, stratum after stratum, so that tenths differ by one sample at most."""
    rng = np.random.default_rng(seed)
    members: dict[tuple[str, ...], list[int]] = defaultdict(list)
    for index, stratum in enumerate(strata):
        members[stratum].append(index)
    tenth = [0] * len(strata)
    dealt = 0
    for stratum in sorted(members):
        for index in rng.permutation(members[stratum]):
            tenth[index] = dealt % _TENTHS
            dealt += 1
    return tenth


def _by_pose(rows: Sequence[Row], seed: int) -> list[dict[str, Role]]:
    poses: dict[str, tuple[float, float]] = {}
    for row in rows:
        try:
            distance_m, bearing_rad = float(row["distance_m"]), math.radians(float(row["robot_angle_deg"]))
            poses[row["pose_id"]] = (distance_m * math.cos(bearing_rad), distance_m * math.sin(bearing_rad))
        except (KeyError, ValueError) as error:
            raise DatasetError(
                f"protocol by-pose needs the pose of every sample; {row['sample_id']} has none (prepare with --poses)"
            ) from error
    names = sorted(poses)
    positions = np.array([poses[name] for name in names])  # (P, 2) metres
    block = _blocks(positions)
    roles: list[dict[str, Role]] = []
    for fold in range(NUM_FOLDS):
        tested = (block == 2 * fold) | (block == 2 * ((fold + 2) % NUM_FOLDS) + 1)
        to_tested_m, _ = cKDTree(positions[tested]).query(positions)
        near = np.asarray(to_tested_m) <= EMBARGO_M + 1e-9
        free = np.flatnonzero(~near)
        rng = np.random.default_rng([seed, fold])
        # One part in eight of what may be learned from: 10 to 70 as in the paper.
        validation = set(rng.permutation(free)[: max(1, round(len(free) / 8))].tolist())
        role: dict[str, Role] = {}
        for number, name in enumerate(names):
            if tested[number]:
                role[name] = "test"
            elif near[number]:
                role[name] = "unused"
            else:
                role[name] = "val" if number in validation else "train"
        roles.append({row["sample_id"]: role[row["pose_id"]] for row in rows})
    return roles


def _blocks(positions: np.ndarray) -> np.ndarray:
    """Number of the block of every pose: 2 x sector + ring, ten blocks of equal count; (P,)."""
    bearing = np.arctan2(positions[:, 1], positions[:, 0])
    distance = np.hypot(positions[:, 0], positions[:, 1])
    sector = np.empty(len(positions), dtype=np.int64)
    ring = np.empty(len(positions), dtype=np.int64)
    for number, members in enumerate(np.array_split(np.lexsort((distance, bearing)), NUM_FOLDS)):
        sector[members] = number
        by_distance = members[np.lexsort((bearing[members], distance[members]))]
        ring[by_distance] = np.arange(len(members)) >= len(members) // 2
    return 2 * sector + ring


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
    """Read what `write_splits` wrote.

    Raises:
        DatasetError: not such a file.
    """
    rows = read_csv(path)
    if not rows or "sample_id" not in rows[0] or "fold_0" not in rows[0]:
        raise DatasetError(f"{path}: is not a file of splits")
    splits: list[dict[str, Role]] = []
    for fold in range(len(rows[0]) - 1):
        roles: dict[str, Role] = {}
        for row in rows:
            role = row.get(f"fold_{fold}")
            if role not in ("train", "val", "test", "unused"):
                raise DatasetError(f"{path}: {row['sample_id']} has role {role!r} in fold {fold}")
            roles[row["sample_id"]] = role  # type: ignore[assignment]
        splits.append(roles)
    return splits
