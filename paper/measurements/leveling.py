# SPDX-License-Identifier: Apache-2.0
"""Error of the tilt and of the floor's height that clouds show, and the time it takes."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np

from doorstate._jobs import Progress
from doorstate.clouds.floor import find_floor_z_m
from doorstate.clouds.leveling import Leveling, level_cloud
from doorstate.clouds.vertical import find_vertical
from doorstate.clouds.view_planes import find_planes, sample_ahead
from doorstate.evaluation.table import Table
from doorstate.io.rotations import tilt_matrix
from doorstate.simulation.frames import replay
from doorstate.simulation.generate import with_sensor
from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.types import Points

from ..answers import gazebo_frames

Mount = Literal["level", "tilted", "on its side"]
MOUNTS: tuple[Mount, ...] = ("level", "tilted", "on its side")
SOURCES = [(preset, sensor) for preset in ("varied", "cluttered", "no-door") for sensor in ("xtion", "d435")]
REASONS = ("tilt_ambiguous", "tilt_upside_down", "tilt_one_plane")
_SEED = 1_000_033  # of no data set, and unused while constants of the estimate were chosen
_MAX_TILT_DEG = 30.0
_WRONG_DEG = 10.0


class TiltedCloud(NamedTuple):
    """Cloud in the frame of a tilted camera."""

    points: Points
    roll_deg: float
    pitch_deg: float
    height_m: float | None  # of the camera


class LevelingResult(NamedTuple):
    """Outcome for one cloud."""

    error_deg: float | None  # None where the tilt is refused
    stated_deg: float | None
    floor_error_m: float | None
    reason: str


Group = tuple[str, str, str, list[LevelingResult]]
"""Source, camera, how the tilt was made, and the results."""


def draw_tilt(mount: Mount, rng: np.random.Generator) -> tuple[float, float]:
    """Return roll and pitch: within a degree of level, or within 30 degrees of upright or of lying on a side."""
    if mount == "level":
        roll_deg, pitch_deg = rng.uniform(-1, 1, 2)
        return float(roll_deg), float(pitch_deg)
    while True:
        roll_deg, pitch_deg = float(rng.uniform(-30, 30)), float(rng.uniform(-20, 35))
        cosine = math.cos(math.radians(roll_deg)) * math.cos(math.radians(pitch_deg))
        if cosine >= math.cos(math.radians(_MAX_TILT_DEG)):
            break
    quarter = 0.0 if mount == "tilted" else float(rng.choice((-90, 90)))
    return roll_deg + quarter, pitch_deg


def simulated_clouds(
    preset: str, sensor: str, mount: Mount, count: int, *, rendered: bool
) -> Iterator[TiltedCloud]:
    """Yield clouds of one preset and sensor.

    Args:
        preset: kind of rooms.
        sensor: name of the sensor model.
        mount: how the camera is mounted.
        count: number of scenes.
        rendered: render what the tilted camera sees; else turn the level cloud of a camera that looks ahead.
    """
    for number in range(count):
        rows = draw_rows(PRESETS[preset], _SEED, number)
        row = with_sensor(rows[number % len(rows)], sensor)
        roll_deg, pitch_deg = draw_tilt(mount, np.random.default_rng(number))
        if rendered:
            row = row.model_copy(update={"roll_deg": roll_deg, "pitch_deg": pitch_deg})
        yield tilted(replay(row).points, roll_deg, pitch_deg, row.camera_height_m)


def gazebo_clouds(mount: Mount, count: int) -> Iterator[TiltedCloud]:
    """Yield the frames that Gazebo rendered, turned."""
    for number, (_, points) in zip(range(count), gazebo_frames(), strict=False):
        yield tilted(points, *draw_tilt(mount, np.random.default_rng(number)), None)


def tilted(level: Points, roll_deg: float, pitch_deg: float, height_m: float | None) -> TiltedCloud:
    """Return a level cloud in the frame of its camera."""
    points = (level.astype(np.float64) @ np.array(tilt_matrix(roll_deg, pitch_deg))).astype(np.float32)
    return TiltedCloud(points, roll_deg, pitch_deg, height_m)


def measure_clouds(clouds: Iterable[TiltedCloud]) -> list[LevelingResult]:
    """Return one result a cloud."""
    return [_result(cloud, level_cloud(cloud.points)) for cloud in clouds]


def measure_leveling(count: int, progress: Progress) -> list[Group]:
    """Return the results of `count` clouds of each source and camera."""
    groups: list[Group] = []
    jobs = [
        (preset, sensor, mount, rendered)
        for preset, sensor in SOURCES
        for mount in MOUNTS
        for rendered in (True, False)
        if rendered or mount != "level"
    ]
    for number, (preset, sensor, mount, rendered) in enumerate(jobs):
        progress(number, len(jobs))
        results = measure_clouds(simulated_clouds(preset, sensor, mount, count, rendered=rendered))
        groups.append((f"{preset} {sensor}", mount, "rendered" if rendered else "turned", results))
    for mount in MOUNTS:
        groups.append(("gazebo", mount, "turned", measure_clouds(gazebo_clouds(mount, count))))
    progress(len(jobs), len(jobs))
    return groups


def leveling_table(groups: Sequence[Group]) -> Table:
    """Return one row per source, camera and kind of tilt, and one for all sources of each."""
    pooled = [
        _pooled(groups, mounts, made)
        for mounts, made in (
            (("level",), "rendered"),
            (("tilted",), "rendered"),
            (("on its side",), "rendered"),
            (("tilted", "on its side"), "rendered"),
            (("tilted", "on its side"), "turned"),
        )
    ]
    return Table(
        "Tilt told from the cloud",
        (
            "source",
            "camera",
            "tilt",
            "clouds",
            "answered",
            f"off by more than {_WRONG_DEG:g} deg",
            "median error, deg",
            "95th percentile",
            "within 2 stated errors",
            "floor found",
            "median floor error, mm",
            *(reason.removeprefix("tilt_").replace("_", " ") for reason in REASONS),
        ),
        tuple(_line(*group) for group in (*groups, *pooled) if group[3]),
        "Level: within 1 degree. Tilted: roll -30 to 30, pitch -20 to 35 degrees, together at most 30; on its side: a "
        "quarter turn more. Rendered: the tilted camera's own view; turned: the cloud of a camera that looks ahead, "
        "rotated. Errors are those of answered clouds; the last columns count refusals by reason.",
        text_columns=3,
    )


def _pooled(groups: Sequence[Group], mounts: Sequence[str], made: str) -> Group:
    """Return the results of all sources with these cameras."""
    results = [
        result for _, mount, how, of_group in groups if mount in mounts and how == made for result in of_group
    ]
    return "all", " or ".join(mounts), made, results


def measure_time(repeats: int = 41) -> Table:
    """Return the processor time for a cloud of 640 x 480 pixels by step."""
    cloud = next(simulated_clouds("varied", "xtion", "tilted", 1, rendered=True)).points
    sample = sample_ahead(cloud)
    planes = find_planes(sample)
    steps: dict[str, Callable[[], object]] = {
        "sample": lambda: sample_ahead(cloud),
        "planes": lambda: find_planes(sample),
        "vertical": lambda: find_vertical(planes, sample),
        "floor": lambda: find_floor_z_m(cloud),
        "all, with turning the points": lambda: level_cloud(cloud),
    }
    rows = []
    for name, call in steps.items():
        times_ms = []
        for _ in range(repeats):
            started = time.process_time()
            call()
            times_ms.append(1000 * (time.process_time() - started))
        rows.append((name, f"{np.median(times_ms):.2f}", f"{min(times_ms):.2f}"))
    return Table("Time to level a cloud", ("step", "median, ms", "least, ms"), tuple(rows), "Processor time.")


def _result(cloud: TiltedCloud, leveling: Leveling) -> LevelingResult:
    if leveling.refusal is not None:
        return LevelingResult(None, None, None, leveling.refusal.code)
    true_up = np.array(tilt_matrix(cloud.roll_deg, cloud.pitch_deg))[2]
    cosine = min(1.0, float(leveling.rotation[2] @ true_up))
    known = cloud.height_m is not None and leveling.floor_z_m is not None
    return LevelingResult(
        math.degrees(math.acos(cosine)),
        leveling.error_deg,
        abs(leveling.floor_z_m + cloud.height_m) if known else None,  # type: ignore[operator]
        "",
    )


def _line(source: str, mount: str, made: str, results: Sequence[LevelingResult]) -> tuple[str, ...]:
    errors = np.array([result.error_deg for result in results if result.error_deg is not None])
    stated = np.array([result.stated_deg for result in results if result.stated_deg is not None])
    floor_m = [result.floor_error_m for result in results if result.floor_error_m is not None]
    reasons = Counter(result.reason for result in results)
    counts = (str(reasons[reason]) for reason in REASONS)
    if len(errors) == 0:
        return (source, mount, made, str(len(results)), "0%", *["–"] * 6, *counts)
    return (
        source,
        mount,
        made,
        str(len(results)),
        f"{len(errors) / len(results):.0%}",
        str(int((errors > _WRONG_DEG).sum())),
        f"{np.median(errors):.2f}",
        f"{np.quantile(errors, 0.95):.2f}",
        f"{(errors <= 2 * stated).mean():.0%}",
        f"{len(floor_m) / len(results):.0%}" if source != "gazebo" else "–",
        f"{1000 * np.median(floor_m):.1f}" if floor_m else "–",
        *counts,
    )
