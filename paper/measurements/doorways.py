# SPDX-License-Identifier: Apache-2.0
"""Doors among the candidates that the finder proposes on simulated frames, and its time."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import pandas as pd

from doorstate._jobs import Progress
from doorstate.clouds.floor import find_floor_z_m
from doorstate.clouds.outliers import remove_outliers
from doorstate.doorways.doorway import Doorway
from doorstate.doorways.finder import find_doorways
from doorstate.evaluation.table import Table, count_column, label_column, number_column
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.presets import PRESETS, PresetName
from doorstate.simulation.truth import TrueDoor, true_doors

_SEED = 1_000_003  # of no data set
SOURCES: tuple[tuple[PresetName, str], ...] = tuple(
    (preset, sensor)
    for preset in ("varied", "cluttered", "corridor", "two-doors", "no-door")
    for sensor in ("xtion", "d435")
)
_EXACT_M, _EXACT_DEG = 0.08, 4.0
_NEAR_M, _NEAR_DEG = 0.35, 20.0  # a network corrects a candidate so near
_VISIBLE_PX = 1500


class DoorResult(NamedTuple):
    """One visible door, and the nearest candidate."""

    preset: str
    sensor: str
    state: str
    distance_m: float  # of the door from the camera
    is_exact: bool
    is_near: bool
    is_first: bool  # the best candidate is the near one


class FrameResult(NamedTuple):
    """Candidates of one frame."""

    preset: str
    sensor: str
    candidates: int
    milliseconds: float  # of one core


def measure_doorways(scenes: int, progress: Progress) -> tuple[list[DoorResult], list[FrameResult]]:
    """Return the results of all doors with at least 1500 visible pixels, and of all frames.

    Args:
        scenes: scenes of each preset and sensor.
        progress: called after each scene.
    """
    doors: list[DoorResult] = []
    frames: list[FrameResult] = []
    for number, (preset, sensor) in enumerate(SOURCES):
        for index in range(scenes):
            for row, frame in zip(*simulate_rows(PRESETS[preset], _SEED, index, sensor), strict=True):
                cloud = remove_outliers(frame.points).points
                floor_m = find_floor_z_m(cloud)
                started = time.process_time()
                candidates = find_doorways(cloud, floor_m)
                milliseconds = (time.process_time() - started) * 1000
                frames.append(FrameResult(preset, sensor, len(candidates), milliseconds))
                doors += _door_results(preset, sensor, true_doors(row), candidates)
            progress(number * scenes + index + 1, len(SOURCES) * scenes)
    return doors, frames


def doorways_table(doors: Sequence[DoorResult], frames: Sequence[FrameResult]) -> Table:
    """Return recall, candidates and time by preset and sensor."""
    found, looked = pd.DataFrame(doors), pd.DataFrame(frames)
    lines = []
    for (preset, sensor), part in looked.groupby(["preset", "sensor"], sort=False):
        of_doors = found[(found["preset"] == preset) & (found["sensor"] == sensor)]
        lines.append(
            {
                "preset": preset,
                "sensor": sensor,
                "doors": len(of_doors),
                "near": of_doors["is_near"].mean(),
                "exact": of_doors["is_exact"].mean(),
                "first": of_doors["is_first"].mean(),
                "candidates": part["candidates"].mean(),
                "milliseconds": part["milliseconds"].median(),
            }
        )
    return Table.from_frame(
        "Doors among the candidates",
        pd.DataFrame(lines),
        [
            label_column("preset"),
            label_column("sensor"),
            count_column("doors"),
            number_column("near", f"within {_NEAR_M} m and {_NEAR_DEG:g}°", 3),
            number_column("exact", f"within {_EXACT_M} m and {_EXACT_DEG:g}°", 3),
            number_column("first", "best candidate", 3),
            number_column("candidates", "candidates a frame", 1),
            number_column("milliseconds", "ms", 1),
        ],
        note=f"Doors with at least {_VISIBLE_PX} visible pixels of leaf, frame or opening; time of one core, median.",
    )


def _door_results(
    preset: str, sensor: str, doors: Sequence[TrueDoor], candidates: Sequence[Doorway]
) -> Iterator[DoorResult]:
    for door in doors:
        if door.visible_px.total < _VISIBLE_PX:
            continue
        errors = [candidate.gap_to(door.x_m, door.y_m, door.yaw_deg) for candidate in candidates]
        near = [place_m <= _NEAR_M and turn_deg <= _NEAR_DEG for place_m, turn_deg in errors]
        exact = [place_m <= _EXACT_M and turn_deg <= _EXACT_DEG for place_m, turn_deg in errors]
        yield DoorResult(
            preset=preset,
            sensor=sensor,
            state=str(door.state),
            distance_m=math.hypot(door.x_m, door.y_m),
            is_exact=any(exact),
            is_near=any(near),
            is_first=any(near[:1]),
        )
