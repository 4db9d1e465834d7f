# SPDX-License-Identifier: Apache-2.0
"""Doors among the candidates that the finder proposes on simulated frames, and its time."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
import pandas as pd

from doorstate._jobs import Progress
from doorstate.clouds.floor import find_floor_z_m
from doorstate.clouds.outliers import remove_outliers
from doorstate.dataset.crops import HIT_DEG, HIT_M, is_hit
from doorstate.doorways.candidate_errors import ONE_SIGMA
from doorstate.doorways.doorway import Doorway, Placed, gap
from doorstate.doorways.finder import find_doorways
from doorstate.evaluation.table import Table, count_column, label_column, number_column
from doorstate.simulation.frames import Frame
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.presets import PRESETS, PresetName
from doorstate.simulation.row import Row
from doorstate.simulation.truth import TrueDoor, true_doors

SEED = 1_000_003  # of no data set
Source = tuple[PresetName, str]
"""Preset and sensor of simulated frames."""
SOURCES: tuple[Source, ...] = (
    *(
        (preset, sensor)
        for preset in ("varied", "cluttered", "corridor", "two-doors", "no-door")
        for sensor in ("xtion", "d435")
    ),
    *(
        (preset, sensor)
        for preset in ("building", "building-no-door")
        for sensor in ("xtion-matching", "d435-matching", "azure-kinect")
    ),
)
VISIBLE_PX = 1500  # of a door that should be found
_EXACT_M, _EXACT_DEG = 0.08, 4.0


AnyPlaced = TypeVar("AnyPlaced", bound=Placed)


class View(NamedTuple):
    """One simulated frame."""

    preset: str
    sensor: str
    row: Row
    frame: Frame


class DoorResult(NamedTuple):
    """One visible door, and the nearest candidate."""

    preset: str
    sensor: str
    state: str
    distance_m: float  # of the door from the camera
    is_exact: bool
    is_near: bool
    is_first: bool  # the best candidate is the near one


class CandidateResult(NamedTuple):
    """One candidate that hits a visible door, and its errors, all of them positive."""

    score: float
    along_m: float
    across_m: float
    yaw_deg: float
    width_m: float


class FrameResult(NamedTuple):
    """Candidates of one frame."""

    preset: str
    sensor: str
    candidates: int
    milliseconds: float  # of one core


def simulated_views(
    sources: Sequence[Source], scenes: int, progress: Progress, seed: int = SEED
) -> Iterator[View]:
    """Yield the frames of presets and sensors.

    Args:
        sources: presets and sensors.
        scenes: scenes of each preset and sensor.
        progress: called after each scene.
        seed: seed of the scenes.
    """
    for number, (preset, sensor) in enumerate(sources):
        for index in range(scenes):
            for row, frame in zip(*simulate_rows(PRESETS[preset], seed, index, sensor), strict=True):
                yield View(preset, sensor, row, frame)
            progress(number * scenes + index + 1, len(sources) * scenes)


def visible_doors(row: Row) -> list[TrueDoor]:
    """Return the doors that should be found: at least 1500 pixels see their leaf, their frame or into their opening.

    Nothing is seen of an opening beyond the range of the camera.
    """
    return [door for door in true_doors(row) if _seen_px(door, row.camera.max_depth_m) >= VISIBLE_PX]


def _seen_px(door: TrueDoor, range_m: float) -> int:
    seen = door.visible_px
    return seen.leaf + seen.frame + (seen.opening if door.x_m <= range_m else 0)


def nearest(door: TrueDoor, places: Iterable[AnyPlaced]) -> AnyPlaced | None:
    """Return the place nearest to a door, of those within 0.35 m; None if there is none."""
    near = [place for place in places if gap(door, place)[0] <= HIT_M]
    return min(near, key=lambda place: gap(door, place)[0], default=None)


def measure_doorways(
    scenes: int, progress: Progress
) -> tuple[list[DoorResult], list[FrameResult], list[CandidateResult]]:
    """Return the results of all visible doors, of all frames, and of all candidates that hit such a door.

    Args:
        scenes: scenes of each preset and sensor.
        progress: called after each scene.
    """
    doors: list[DoorResult] = []
    frames: list[FrameResult] = []
    hits: list[CandidateResult] = []
    for preset, sensor, row, frame in simulated_views(SOURCES, scenes, progress):
        cloud = remove_outliers(frame.points).points
        floor_m = find_floor_z_m(cloud)
        started = time.process_time()
        candidates = find_doorways(cloud, floor_m)
        milliseconds = (time.process_time() - started) * 1000
        frames.append(FrameResult(preset, sensor, len(candidates), milliseconds))
        for door in visible_doors(row):
            doors.append(_door_result(preset, sensor, door, candidates))
            hits += (_errors(door, candidate) for candidate in candidates if is_hit(door, candidate))
    return doors, frames, hits


def doorways_table(doors: Sequence[DoorResult], frames: Sequence[FrameResult]) -> Table:
    """Return recall, candidates and time by preset and sensor, and of all."""
    lines = []
    for source, of_doors, part in by_source(pd.DataFrame(doors), pd.DataFrame(frames)):
        lines.append(
            source
            | {
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
            number_column("near", f"within {HIT_M} m and {HIT_DEG:g}°", 3),
            number_column("exact", f"within {_EXACT_M} m and {_EXACT_DEG:g}°", 3),
            number_column("first", "best candidate", 3),
            number_column("candidates", "candidates a frame", 1),
            number_column("milliseconds", "ms", 1),
        ],
        note=f"Doors with at least {VISIBLE_PX} visible pixels of leaf, frame or opening; time of one core, median.",
    )


def by_source(
    doors: pd.DataFrame, frames: pd.DataFrame
) -> Iterator[tuple[dict[str, Any], pd.DataFrame, pd.DataFrame]]:
    """Yield preset and sensor as columns of a table, and the doors and frames of each and, at last, of all."""
    for (preset, sensor), of_frames in frames.groupby(["preset", "sensor"], sort=False):
        of_doors = doors[(doors["preset"] == preset) & (doors["sensor"] == sensor)]
        yield {"preset": preset, "sensor": sensor, "doors": len(of_doors)}, of_doors, of_frames
    yield {"preset": "all", "sensor": "all", "doors": len(doors)}, doors, frames


def errors_table(hits: Sequence[CandidateResult]) -> Table:
    """Return the errors of candidates by score, to compare with `doorstate.doorways.candidate_errors`."""
    found = pd.DataFrame(hits, columns=CandidateResult._fields)
    tenth = np.floor(found["score"] * 10).clip(upper=9).astype(int)
    lines = found.drop(columns="score").groupby(tenth).quantile(ONE_SIGMA)
    lines.insert(0, "candidates", found.groupby(tenth).size())
    lines.insert(0, "score", [f"{low / 10:.1f} to {(low + 1) / 10:.1f}" for low in lines.index])
    return Table.from_frame(
        "Errors of candidates by score",
        lines,
        [
            label_column("score"),
            count_column("candidates"),
            number_column("along_m", "along the wall, m", 3),
            number_column("across_m", "across, m", 3),
            number_column("yaw_deg", "yaw, °", 2),
            number_column("width_m", "width, m", 2),
        ],
        note=f"Candidates within {HIT_M} m and {HIT_DEG:g}° of a door; 68 % of the errors are smaller.",
    )


def _errors(door: TrueDoor, candidate: Doorway) -> CandidateResult:
    place = np.array([door.x_m, door.y_m, candidate.floor_z_m], np.float32)
    along_m, across_m, _ = candidate.to_doorway(place).tolist()
    width_m = abs(candidate.width_m - door.width_m)
    return CandidateResult(candidate.score, abs(along_m), abs(across_m), gap(door, candidate)[1], width_m)


def _door_result(preset: str, sensor: str, door: TrueDoor, candidates: Sequence[Doorway]) -> DoorResult:
    near = [is_hit(door, candidate) for candidate in candidates]
    gaps = [gap(door, candidate) for candidate in candidates]
    exact = [place_m <= _EXACT_M and turn_deg <= _EXACT_DEG for place_m, turn_deg in gaps]
    return DoorResult(
        preset=preset,
        sensor=sensor,
        state=str(door.state),
        distance_m=math.hypot(door.x_m, door.y_m),
        is_exact=any(exact),
        is_near=any(near),
        is_first=any(near[:1]),
    )
