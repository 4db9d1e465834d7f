# SPDX-License-Identifier: Apache-2.0
"""Clouds of doors for measurements, the same in every run: simulated, or from a prepared data set."""

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

    def first_points(self, num_points: int) -> Clouds:
        """Return the first points of every cloud, normalised for a network."""
        return Clouds(normalize(self.points[:, :num_points]), self.labels)


def raw_cloud() -> Points:
    """Return one simulated organized cloud (480, 640, 3) in metres, NaN where nothing was measured."""
    return replay(draw_rows(PRESETS["ogurob"], 0, PRESETS["ogurob"].indices(3)[1])[1]).points


def sensor_cloud(preset: str, sensor: str) -> Points:
    """Return one simulated organized cloud (480, 640, 3) of a preset, with the noise of a sensor."""
    row = draw_rows(PRESETS[preset], 0, 0)[0]
    return replay(row.model_copy(update={"sensor": sensor})).points


def raw_clouds(count: int) -> list[Points]:
    """Return simulated organized clouds of doors in all states, from poses all over the room."""
    return [replay(row).points for row in reference_rows(count)]


def simulated_clouds(count: int, num_points: int) -> Clouds:
    """Return `raw_clouds`, prepared.

    Raises:
        ConfigError: a cloud has fewer points.
    """
    return Clouds(*reference_clouds(count, num_points))


def dataset_clouds(folder: Path, count: int, num_points: int) -> Clouds:
    """Return clouds at equal intervals in a prepared data set.

    Raises:
        ConfigError: the data set has fewer clouds or points.
        DatasetError: there is none, or it is damaged.
    """
    dataset = open_dataset(folder)
    if dataset.num_points < num_points or len(dataset) < count:
        raise ConfigError(
            f"holds {len(dataset)} clouds of {dataset.num_points} points",
            path=folder,
            expected=f"{count} of {num_points}",
        )
    indices = np.linspace(0, len(dataset) - 1, count).astype(np.int64)
    return Clouds(np.array(dataset.clouds[indices, :num_points]), dataset.labels[indices])
