# SPDX-License-Identifier: Apache-2.0
"""Distributions of the presets of buildings: layouts, kinds, angles, distances, pixels, and the time of drawing."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from doorstate._jobs import Progress
from doorstate.evaluation.table import Table
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.presets import PRESETS, PresetName
from doorstate.simulation.row import Row

_SEED = 1_000_003  # of no data set
NAMES: tuple[PresetName, ...] = ("building", "building-no-door")
_QUANTILES = (0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0)


class Measured(NamedTuple):
    """Rows of the first samples of scenes, and the seconds of a processor that drawing each scene took."""

    rows: list[Row]
    draw_s: list[float]


def measure_buildings(scenes: int, progress: Progress) -> Mapping[PresetName, Measured]:
    """Draw scenes of both presets, and render one sample of each."""
    measured = {}
    for place, name in enumerate(NAMES):
        rows, seconds = [], []
        for index in range(scenes):
            progress(place * scenes + index, len(NAMES) * scenes)
            start = time.process_time()
            PRESETS[name].draw(_SEED, index)
            seconds.append(time.process_time() - start)
            rows.append(simulate_rows(PRESETS[name], _SEED, index)[0][0])
        measured[name] = Measured(rows, seconds)
    progress(1, 1)
    return measured


def quantile_table(measured: Mapping[PresetName, Measured]) -> Table:
    """Return quantiles of what describes a view."""
    lines = [(name, *line) for name, one in measured.items() for line in _quantities(one)]
    return Table(
        "Views of the presets of buildings",
        ("preset", "quantity", *(f"{100 * share:.0f} %" for share in _QUANTILES)),
        tuple(
            (name, title, *(f"{value:.{digits}f}" for value in np.quantile(values, _QUANTILES)))
            for name, title, values, digits in lines
        ),
        "Quantiles over scenes; those of doors are of the closed main door.",
        2,
    )


def share_table(measured: Mapping[PresetName, Measured]) -> Table:
    """Return the shares of layouts, kinds of doors and subjects, and numbers of doors."""
    lines = [(name, *line) for name, one in measured.items() for line in _shares(one.rows)]
    return Table(
        "Contents of the presets of buildings",
        ("preset", "quantity", "value", "scenes"),
        tuple((name, title, value, f"{100 * share:.0f} %") for name, title, value, share in lines),
        "",
        3,
    )


def _quantities(one: Measured) -> Iterator[tuple[str, Sequence[float], int]]:
    rows = one.rows
    total_px = rows[0].camera.width * rows[0].camera.height
    yield "distance, m", [row.distance_m for row in rows], 1
    yield "beside the normal, degrees", [abs(90 - row.robot_angle_deg) for row in rows], 0
    yield "from the view's axis, degrees", [abs(row.heading_offset_deg) for row in rows], 0
    yield "camera height, m", [row.camera_height_m for row in rows], 2
    yield "pitch, degrees", [row.pitch_deg for row in rows], 0
    yield "pixels measured, %", [100 * row.measured_px / total_px for row in rows], 0
    if rows[0].scene.door:
        door_px = [row.visible_leaf_px + row.visible_frame_px for row in rows]
        yield "pixels of leaf and frame, %", [100 * pixels / total_px for pixels in door_px], 1
        yield "door hidden by clutter, %", [100 * (row.occluded_share or 0.0) for row in rows], 0
    yield "time of drawing, ms", [1000 * seconds for seconds in one.draw_s], 1


def _shares(rows: Sequence[Row]) -> Iterator[tuple[str, str, float]]:
    columns: Mapping[str, list[str]] = {
        "layout": [row.scene.layout or "" for row in rows],
        "kind": [row.door_kind or row.scene_kind for row in rows],
        "doors": [str(1 + len(row.other_doors)) if row.scene.door else "0" for row in rows],
        "people": [str(len(row.scene.people or ())) for row in rows],
    }
    for title, values in columns.items():
        for value in sorted(set(values)):
            yield title, value.replace("_", " "), values.count(value) / len(values)
