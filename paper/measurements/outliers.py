# SPDX-License-Identifier: Apache-2.0
"""Points that are removed as outliers from clouds without ghosts, by part of the scene, and the time it takes."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np

from doorstate._jobs import Progress
from doorstate.clouds.measured import is_measured
from doorstate.clouds.outliers import outlier_mask
from doorstate.evaluation.table import Table
from doorstate.simulation.frames import Frame
from doorstate.types import Part

from .frames import SOURCES, reference_frames, scene_frames

_PARTS = (Part.WALL, Part.FRAME, Part.LEAF, Part.FLOOR, Part.OTHER)


class PartCounts(NamedTuple):
    """Measured and removed points of one source, by part."""

    measured: Counter[int]
    removed: Counter[int]  # of the images
    removed_flat: Counter[int]  # of the flat clouds


def measure_parts(count: int, progress: Progress) -> dict[tuple[str, str], PartCounts]:
    """Return the counts of `count` frames of each preset and sensor."""
    counts: dict[tuple[str, str], PartCounts] = {}
    for number, (preset, sensor) in enumerate(SOURCES):

        def report(done: int, _: int, start: int = number * count) -> None:
            progress(start + done, len(SOURCES) * count)

        frames = (
            reference_frames(count, report)
            if preset == "ogurob"
            else scene_frames(count, sensor, report, preset)
        )
        total = PartCounts(Counter(), Counter(), Counter())
        for _, frame in frames:
            for sums, mask in zip(total, _masks(frame), strict=True):
                sums.update(frame.cut.part[mask].tolist())
        counts[preset, sensor] = total
    return counts


def parts_table(counts: Mapping[tuple[str, str], PartCounts]) -> Table:
    """Return one row per source: share of the measured points that are removed, by part."""
    rows = []
    for source, sums in counts.items():
        for form, removed in (("image", sums.removed), ("flat", sums.removed_flat)):
            shares = [
                f"{removed[part] / sums.measured[part]:.2%}" if sums.measured[part] else "–"
                for part in _PARTS
            ]
            rows.append((*source, form, *shares))
    return Table(
        "Points removed without ghosts",
        ("preset", "sensor", "cloud", *(part.name.lower() for part in _PARTS)),
        tuple(rows),
        "Share of the measured points of each part. Sensors with noise have pixels between two surfaces, which count "
        "for either.",
        text_columns=3,
    )


def measure_cost(repeats: int = 21) -> Table:
    """Return the processor time for one cloud of 640 x 480 pixels, as an image and flat."""
    (_, frame), *_ = scene_frames(1, "xtion", lambda done, total: None)
    image = frame.points
    flat = np.ascontiguousarray(image[is_measured(image)])
    rows = []
    for name, cloud in (("image", image), ("flat", flat), ("flat, every 15th point", flat[::15].copy())):
        times_ms = _times_ms(partial(outlier_mask, cloud), repeats)
        rows.append((name, str(cloud[..., 0].size), f"{np.median(times_ms):.1f}", f"{min(times_ms):.1f}"))
    return Table(
        "Time to find outliers",
        ("cloud", "points", "median, ms", "least, ms"),
        tuple(rows),
        "Processor time.",
    )


def _times_ms(call: Callable[[], object], repeats: int) -> list[float]:
    times_ms = []
    for _ in range(repeats):
        started = time.process_time()
        call()
        times_ms.append(1000 * (time.process_time() - started))
    return times_ms


def _masks(frame: Frame) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    shape = frame.cut.part.shape
    return (
        is_measured(frame.points),
        outlier_mask(frame.points),
        outlier_mask(frame.points.reshape(-1, 3)).reshape(shape),
    )
