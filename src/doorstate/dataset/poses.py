# SPDX-License-Identifier: Apache-2.0
"""CSV of camera poses of recorded clouds.

Columns are `file` (path below the root, or the bare name) and either `x_m,y_m` (door frame) or
`distance_m,robot_angle_deg`. Further columns are kept, except `sample_id` and `state`.
"""

from __future__ import annotations

import math
from pathlib import Path

from doorstate._files import read_csv
from doorstate.dataset.strata import distance_band, polar, region
from doorstate.errors import DatasetError

_UNITS = ("_m", "_deg", "_px", "_share")


def read_poses(path: Path) -> dict[str, dict[str, str]]:
    """Return the columns of every file, with distance, angle, band and region.

    Raises:
        DatasetError: the file cannot be read, or a line is invalid.
    """
    poses: dict[str, dict[str, str]] = {}
    for number, row in enumerate(read_csv(path), start=2):
        name = row.pop("file", None)
        if not name:
            raise DatasetError(f"line {number} has no value", path=path, field="file")
        if name in poses:
            raise DatasetError(f"line {number} repeats {name!r}", path=path, field="file")
        for reserved in ("sample_id", "state"):
            row.pop(reserved, None)
        _check_numbers(row, path, number)
        poses[name] = row | _strata(row, path, number)
    return poses


def _check_numbers(row: dict[str, str], path: Path, number: int) -> None:
    """Raise DatasetError for a column with a unit in its name and a value that is not a number."""
    for name, value in row.items():
        try:
            if value and name.endswith(_UNITS) and not math.isfinite(float(value)):
                raise ValueError
        except ValueError as error:
            raise DatasetError(
                f"line {number} has {value!r}, which is not a number", path=path, field=name
            ) from error


def _strata(row: dict[str, str], path: Path, number: int) -> dict[str, str]:
    if row.get("x_m") and row.get("y_m"):
        distance_m, angle_deg = polar(float(row["x_m"]), float(row["y_m"]))
        pose_id = row.get("pose_id") or f"{float(row['x_m']):.3f},{float(row['y_m']):.3f}"
    elif row.get("distance_m") and row.get("robot_angle_deg"):
        distance_m, angle_deg = float(row["distance_m"]), float(row["robot_angle_deg"])
        pose_id = row.get("pose_id") or f"{distance_m:.3f},{angle_deg:.3f}"
    else:
        raise DatasetError(
            f"line {number} has no pose", path=path, expected="x_m and y_m, or distance_m and robot_angle_deg"
        )
    return {
        "pose_id": pose_id,
        "distance_m": str(distance_m),
        "robot_angle_deg": str(angle_deg),
        "distance_band": distance_band(distance_m),
        "region": region(angle_deg),
    }
