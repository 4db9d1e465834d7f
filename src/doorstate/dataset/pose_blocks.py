# SPDX-License-Identifier: Apache-2.0
"""Folds of neighbouring poses with an embargo.

The half-ring is cut into five sectors of bearing and two rings of distance; a fold tests the inner block of one sector
and the outer block of another. All samples of a pose stay together, and poses within 0.5 m of a tested one are unused
in that fold. scikit-learn's splitters know groups but no distances between them, so the embargo is our own code.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from doorstate.dataset.roles import Role
from doorstate.errors import DatasetError

EMBARGO_M = 0.5


def split_poses(rows: Sequence[Mapping[str, str]], folds: int, seed: int) -> list[dict[str, Role]]:
    """Return one {sample_id: role} per fold.

    Args:
        rows: samples with `pose_id`, `distance_m` and `robot_angle_deg`.
        folds: number of folds and of sectors.
        seed: seed of the choice of validation poses.

    Raises:
        DatasetError: a row lacks its pose.
    """
    poses = _poses(rows)
    names = sorted(poses)
    positions = np.array([poses[name] for name in names])  # (P, 2) metres
    block = _blocks(positions, folds)
    splits: list[dict[str, Role]] = []
    for fold in range(folds):
        tested = (block == 2 * fold) | (block == 2 * ((fold + 2) % folds) + 1)
        to_tested_m, _ = cKDTree(positions[tested]).query(positions)
        near = np.asarray(to_tested_m) <= EMBARGO_M + 1e-9
        free = np.flatnonzero(~near)
        rng = np.random.default_rng([seed, fold])
        # One in eight of the free poses: 10 to 70 as in the paper.
        validation = set(rng.permutation(free)[: max(1, round(len(free) / 8))].tolist())
        role: dict[str, Role] = {}
        for number, name in enumerate(names):
            if tested[number]:
                role[name] = "test"
            elif near[number]:
                role[name] = "unused"
            else:
                role[name] = "val" if number in validation else "train"
        splits.append({row["sample_id"]: role[row["pose_id"]] for row in rows})
    return splits


def _poses(rows: Sequence[Mapping[str, str]]) -> dict[str, tuple[float, float]]:
    """Return x and y in metres by `pose_id`."""
    poses: dict[str, tuple[float, float]] = {}
    for row in rows:
        try:
            distance_m, bearing_rad = float(row["distance_m"]), math.radians(float(row["robot_angle_deg"]))
            poses[row["pose_id"]] = (distance_m * math.cos(bearing_rad), distance_m * math.sin(bearing_rad))
        except (KeyError, ValueError) as error:
            raise DatasetError(
                f"protocol by-pose needs the pose of every sample, and {row['sample_id']} has none",
                hint="prepare the data set with a CSV of poses",
            ) from error
    return poses


def _blocks(positions: np.ndarray, sectors: int) -> NDArray[np.int64]:
    """Return the block of every pose, (P,): 2 x sector + ring, blocks of equal size."""
    bearing = np.arctan2(positions[:, 1], positions[:, 0])
    distance = np.hypot(positions[:, 0], positions[:, 1])
    sector = np.empty(len(positions), dtype=np.int64)
    ring = np.empty(len(positions), dtype=np.int64)
    for number, members in enumerate(np.array_split(np.lexsort((distance, bearing)), sectors)):
        sector[members] = number
        by_distance = members[np.lexsort((bearing[members], distance[members]))]
        ring[by_distance] = np.arange(len(members)) >= len(members) // 2
    return 2 * sector + ring
