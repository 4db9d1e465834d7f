# SPDX-License-Identifier: Apache-2.0
"""Simulated doors that no weights were trained on, the same every time, for comparisons and measurements."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate._jobs import Progress, no_progress
from doorstate.clouds.normalization import Input
from doorstate.clouds.preparation import CloudSpec, PreparedCloud, prepare_cloud
from doorstate.doorways.crop import CropSpec, crop_cloud
from doorstate.doorways.doorway import Doorway
from doorstate.errors import ConfigError
from doorstate.simulation.frames import replay
from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.simulation.row import Row
from doorstate.simulation.truth import true_doors
from doorstate.types import STATES, Points

_SEED = 1_000_003  # of no data set


class LabelledClouds(NamedTuple):
    """Prepared clouds with the states of their doors."""

    points: Points  # (M, n, 3) metres in farthest-point order
    labels: NDArray[np.int64]  # (M,)


def reference_rows(count: int) -> list[Row]:
    """Return rows of doors in all three states, with poses spread over the room."""
    poses = PRESETS["ogurob"].indices(max(3, -(-count // len(STATES))))
    return [row for pose in poses for row in draw_rows(PRESETS["ogurob"], _SEED, pose)][:count]


def reference_clouds(
    count: int, num_points: int, progress: Progress = no_progress, cloud_input: Input = "whole"
) -> LabelledClouds:
    """Return the rendered and prepared `reference_rows`, whole or cropped to their doors.

    Raises:
        ConfigError: more points than a simulated cloud has.
    """
    rows, clouds = reference_rows(count), []
    spec = CloudSpec(num_points=num_points, thin=True)
    for row in rows:
        points = replay(row).points
        prepared = prepare_cloud(points, spec) if cloud_input == "whole" else _crop(row, points, num_points)
        clouds.append(prepared.points)
        progress(len(clouds), count)
    fewest = min(map(len, clouds))
    if fewest < num_points:
        raise ConfigError(
            f"a simulated cloud has only {fewest} distinct points, not {num_points}", field="num_points"
        )
    labels = np.array([STATES.index(row.state) for row in rows], dtype=np.int64)
    return LabelledClouds(np.stack(clouds), labels)


def _crop(row: Row, points: Points, num_points: int) -> PreparedCloud:
    door = true_doors(row)[0]
    doorway = Doorway(door.x_m, door.y_m, door.yaw_deg, door.width_m, door.floor_z_m)
    return crop_cloud(points, doorway, CropSpec(num_points=num_points))
