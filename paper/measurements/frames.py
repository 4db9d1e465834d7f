# SPDX-License-Identifier: Apache-2.0
"""Simulated doors that no weights were trained on."""

from __future__ import annotations

from collections.abc import Iterator

from doorstate._jobs import Progress
from doorstate.inference.reference_clouds import reference_rows
from doorstate.simulation.frames import Frame, replay
from doorstate.simulation.generate import with_sensor
from doorstate.simulation.presets import PRESETS, PresetName, draw_rows
from doorstate.simulation.row import Row
from doorstate.simulation.settings import SimulationSettings

_SEED = 1_000_003  # of no data set
SOURCES: tuple[tuple[PresetName, str], ...] = (
    ("ogurob", "none"),
    ("varied", "none"),
    ("varied", "xtion"),
    ("varied", "d435"),
    ("varied", "deepdoors2"),
    ("cluttered", "kinect"),
)


def reference_frames(count: int, progress: Progress) -> Iterator[tuple[Row, Frame]]:
    """Yield rows and frames of simulated doors in all states."""
    for number, row in enumerate(reference_rows(count)):
        progress(number, count)
        yield row, replay(row)
    progress(count, count)


def varied_frames(count: int, progress: Progress) -> Iterator[tuple[Row, Frame]]:
    """Yield rows and frames of doors in all states from several presets, scenes and sensors, in equal shares."""
    sources = [
        SimulationSettings(preset=PRESETS[preset], seed=_SEED, sensor=sensor) for preset, sensor in SOURCES
    ]
    number = 0
    for index in range(count):
        for source in sources:
            for row, frame in zip(*source.simulate(index), strict=True):
                if number == count:
                    return
                progress(number, count)
                number += 1
                yield row, frame


def scene_frames(
    count: int, sensor: str, progress: Progress, preset: PresetName = "varied", first: int = 0
) -> Iterator[tuple[Row, Frame]]:
    """Yield rows and frames of doors in different rooms, in all states, as a sensor measures them.

    Args:
        count: number of frames.
        sensor: name of the sensor model.
        progress: called before each frame.
        preset: kind of rooms.
        first: number of the first frame.
    """
    for number in range(first, first + count):
        progress(number - first, count)
        rows = draw_rows(PRESETS[preset], _SEED, number // 3)
        row = with_sensor(rows[number % 3], sensor)
        yield row, replay(row)
    progress(count, count)
