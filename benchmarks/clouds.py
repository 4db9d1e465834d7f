# SPDX-License-Identifier: Apache-2.0
"""Door clouds to measure with: the same ones every time, simulated or from a prepared data set."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from doorstate.clouds.normalization import normalize
from doorstate.dataset.store import open_dataset
from doorstate.errors import ConfigError
from doorstate.inference.reference_clouds import LabelledClouds, reference_clouds, reference_rows
from doorstate.simulation.frames import replay
from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.types import Points


class Clouds(LabelledClouds):
    """Prepared clouds and their labels."""

    def cut(self, num_points: int) -> Clouds:
        """The first points of every cloud, normalised as a network wants them."""
        return Clouds(normalize(self.points[:, :num_points]), self.labels)


def raw_cloud() -> Points:
    """(480, 640, 3) organized cloud in metres as the simulated depth camera gives it, NaN where nothing is."""
    return replay(draw_rows(PRESETS["ogurob"], 0, PRESETS["ogurob"].indices(3)[1])[1]).points


def raw_clouds(count: int) -> list[Points]:
    """As `raw_cloud`, of doors in all three states, poses spread over the room."""
    return [replay(row).points for row in reference_rows(count)]


def simulated_clouds(count: int, num_points: int) -> Clouds:
    """As `raw_clouds`, prepared.

    Raises:
        ConfigError: more points are asked for than a cloud has.
    """
    return Clouds(*reference_clouds(count, num_points))


def dataset_clouds(folder: Path, count: int, num_points: int) -> Clouds:
    """Clouds spread evenly over a prepared data set.

    Raises:
        ConfigError: the data set has fewer clouds or points.
        DatasetError: there is none, or it is damaged.
    """
    dataset = open_dataset(folder)
    if dataset.num_points < num_points or len(dataset) < count:
        raise ConfigError(
            f"{folder}: holds {len(dataset)} clouds of {dataset.num_points} points, "
            f"{count} of {num_points} are needed"
        )
    chosen = np.linspace(0, len(dataset) - 1, count).astype(np.int64)
    return Clouds(np.array(dataset.clouds[chosen, :num_points]), dataset.labels[chosen])
