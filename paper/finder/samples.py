# SPDX-License-Identifier: Apache-2.0
"""Walls of simulated frames, with the doors on them as targets of columns."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate._files import atomic_path
from doorstate._jobs import Progress, default_workers, no_progress, piece_paths, run_pieces
from doorstate.clouds.outliers import remove_outliers
from doorstate.doorways.column_scorer import USUAL_WIDTH_M, column_features
from doorstate.doorways.elevation import MAX_COLUMNS, NUM_ROWS, Elevation
from doorstate.doorways.finder import surveyed_walls
from doorstate.doorways.walls import Wall
from doorstate.errors import ConfigError
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.presets import PRESETS
from doorstate.simulation.truth import TrueDoor, true_doors

NUM_FEATURES = 7
# Preset, sensor, seed and scenes; no published data set has these seeds.
SOURCES = (
    ("varied", "xtion", 911, 520),
    ("varied", "d435", 912, 330),
    ("varied", "none", 915, 120),
    ("varied", "kinect", 927, 100),
    ("varied", "deepdoors2", 918, 140),
    ("cluttered", "kinect", 913, 240),
    ("cluttered", "xtion", 914, 210),
    ("cluttered", "d435", 926, 80),
    ("corridor", "xtion", 928, 110),
    ("corridor", "d435", 929, 70),
    ("two-doors", "xtion", 930, 110),
    ("two-doors", "d435", 931, 70),
    ("no-door", "xtion", 916, 240),
    ("no-door", "d435", 917, 100),
    ("no-door", "kinect", 919, 60),
    ("building", "xtion-matching", 941, 560),
    ("building", "d435-matching", 942, 360),
    ("building", "d455", 943, 240),
    ("building", "kinect-2", 944, 160),
    ("building", "azure-kinect", 945, 200),
    ("building", "oak-d-pro", 946, 120),
    ("building", "gemini-335", 947, 160),
    ("building-no-door", "xtion-matching", 951, 280),
    ("building-no-door", "d435-matching", 952, 180),
    ("building-no-door", "d455", 953, 120),
    ("building-no-door", "azure-kinect", 955, 120),
)
_SCENES_PER_PIECE = 20
_MIDDLE_SIGMA_M, _END_SIGMA_M = 0.08, 0.05  # of the columns that count as a middle or an end
_NEAR_M = 0.25  # columns so near to a middle learn place, width and depth
_ON_WALL_M, _ON_WALL_DEG = 0.3, 8.0  # a door so near to a wall is on it
_UNSURE_M, _UNSURE_DEG = 0.5, 20.0  # a door so near may be on it
_VISIBLE_PX = 1500  # doors with fewer visible pixels count little ...
_LITTLE, _LITTLE_M = 0.1, 0.6  # ... so little, and so far about their middle


class Targets(NamedTuple):
    """Columns of the array of targets."""

    middle: int = 0  # 1 at a middle, falling to 0
    place: int = 1  # of the middle from the column, metres
    width: int = 2  # logarithm of width / 0.9 m
    depth: int = 3  # of the doorway behind the wall, metres
    is_near: int = 4  # 1 where place, width and depth are learned
    left: int = 5  # as middle
    left_place: int = 6
    right: int = 7
    right_place: int = 8
    weight: int = 9  # of the column in all losses


TARGETS = Targets()
NUM_TARGETS = len(TARGETS)


class WallSamples(NamedTuple):
    """Inputs and targets of W walls, columns padded to `MAX_COLUMNS`."""

    cells: NDArray[np.float16]  # (W, columns, rows, 7)
    columns: NDArray[np.float32]  # (W, columns, 2)
    targets: NDArray[np.float32]  # (W, columns, 10)
    lengths: NDArray[np.int64]  # (W,) columns in use


class _Piece(NamedTuple):
    preset: str
    sensor: str
    seed: int
    scenes: range


def make_samples(
    folder: Path, share: float = 1.0, workers: int | None = None, progress: Progress = no_progress
) -> WallSamples:
    """Simulate all sources, or a share of their scenes, and return their walls; goes on where it was stopped.

    Args:
        folder: files of the pieces.
        share: of the scenes.
        workers: processes; None is one per processor.
        progress: called with pieces done and pieces in all.
    """
    pieces = list(_pieces(share))
    paths = piece_paths(folder, len(pieces), ".npz")
    run_pieces(_simulate, pieces, paths, workers or default_workers(), progress)
    parts = []
    for path in paths:
        with np.load(path) as stored:
            parts.append(WallSamples(*(stored[name] for name in WallSamples._fields)))
    return WallSamples(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def wall_samples(walls: Sequence[tuple[Wall, Elevation]], doors: Sequence[TrueDoor]) -> WallSamples:
    """Return the samples of the walls of one frame."""
    cells = np.zeros((len(walls), MAX_COLUMNS, NUM_ROWS, NUM_FEATURES), np.float16)
    columns = np.zeros((len(walls), MAX_COLUMNS, 2), np.float32)
    targets = np.zeros((len(walls), MAX_COLUMNS, NUM_TARGETS), np.float32)
    lengths = np.array([len(elevation.on_wall) for _, elevation in walls], dtype=np.int64)
    for number, (wall, elevation) in enumerate(walls):
        used = slice(lengths[number])
        cells[number, used], columns[number, used] = column_features(elevation, wall.distance_m)
        targets[number, used, TARGETS.weight] = 1
        for door in doors:
            _add_door(targets[number, used], wall, elevation, door)
    return WallSamples(cells, columns, targets, lengths)


def _add_door(targets: NDArray[np.float32], wall: Wall, elevation: Elevation, door: TrueDoor) -> None:
    place = np.array([[door.x_m, door.y_m]])
    depth_m = float(wall.line.behind_m(place)[0])
    turn_deg = abs(math.remainder(wall.yaw_deg - door.yaw_deg, 360))
    offset_m = float(wall.line.along_m(place)[0]) - elevation.positions_m
    if abs(depth_m) > _ON_WALL_M or turn_deg > _ON_WALL_DEG:
        if abs(depth_m) <= _UNSURE_M and turn_deg <= _UNSURE_DEG:
            targets[:, TARGETS.weight] = 0
        return
    is_near = np.abs(offset_m) < _NEAR_M
    targets[:, TARGETS.middle] = np.maximum(targets[:, TARGETS.middle], _bell(offset_m, _MIDDLE_SIGMA_M))
    targets[is_near, TARGETS.place] = offset_m[is_near]
    targets[is_near, TARGETS.width] = math.log(door.width_m / USUAL_WIDTH_M)
    targets[is_near, TARGETS.depth] = depth_m
    targets[is_near, TARGETS.is_near] = 1
    for side, column in ((0.5, TARGETS.left), (-0.5, TARGETS.right)):
        end_m = offset_m + side * door.width_m
        nearer = np.abs(end_m) < _NEAR_M
        targets[:, column] = np.maximum(targets[:, column], _bell(end_m, _END_SIGMA_M))
        targets[nearer, column + 1] = end_m[nearer]
    if door.visible_px.total < _VISIBLE_PX:
        targets[np.abs(offset_m) < _LITTLE_M, TARGETS.weight] = _LITTLE


def _bell(offset_m: NDArray[np.float64], sigma_m: float) -> NDArray[np.float64]:
    bell: NDArray[np.float64] = np.exp(-0.5 * (offset_m / sigma_m) ** 2)
    return bell


def _pieces(share: float) -> Iterator[_Piece]:
    for preset, sensor, seed, scenes in SOURCES:
        count = max(1, round(share * scenes))
        for start in range(0, count, _SCENES_PER_PIECE):
            yield _Piece(preset, sensor, seed, range(start, min(start + _SCENES_PER_PIECE, count)))


def _simulate(piece: _Piece, path: Path) -> None:
    parts = [wall_samples([], [])]
    for index in piece.scenes:
        try:
            rows, frames = simulate_rows(PRESETS[piece.preset], piece.seed, index, piece.sensor)
        except ConfigError:  # no scene fits
            continue
        for row, frame in zip(rows, frames, strict=True):
            cloud = remove_outliers(frame.points).points
            parts.append(wall_samples(surveyed_walls(cloud, -row.camera_height_m), true_doors(row)))
    samples = WallSamples(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **samples._asdict())
