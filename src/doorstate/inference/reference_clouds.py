# SPDX-License-Identifier: Apache-2.0
"""Simulated doors that no weights were trained on, the same every time, for comparisons and measurements."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate._jobs import Progress, no_progress
from doorstate.clouds.preparation import CloudSpec, prepare_cloud
from doorstate.errors import ConfigError
from doorstate.simulation.frames import replay
from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.simulation.row import Row
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


def reference_clouds(count: int, num_points: int, progress: Progress = no_progress) -> LabelledClouds:
    """Return the rendered and prepared `reference_rows`.

    Raises:
        ConfigError: more points than a simulated cloud has.
    """
    rows, clouds = reference_rows(count), []
    spec = CloudSpec(num_points=num_points, thin=True)
    for row in rows:
        clouds.append(prepare_cloud(replay(row).points, spec).points)
        progress(len(clouds), count)
    fewest = min(map(len, clouds))
    if fewest < num_points:
        raise ConfigError(
            f"a simulated cloud has only {fewest} distinct points, not {num_points}", field="num_points"
        )
    labels = np.array([STATES.index(row.state) for row in rows], dtype=np.int64)
    return LabelledClouds(np.stack(clouds), labels)
