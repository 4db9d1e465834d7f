# SPDX-License-Identifier: Apache-2.0
"""A whole simulated data set on disk: `simulation.json`, `manifest.csv`, and raw files where they are asked for.

The manifest is the data set: a row rebuilds its cloud (generate.replay). Raw clouds, depth and pictures are for other
people's tools.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from PIL import Image
from pydantic import BaseModel, ConfigDict, ValidationError

from doorstate.clouds.pcd import write_pcd
from doorstate.errors import ConfigError, DatasetError
from doorstate.files import atomic_path, is_vacant, write_text
from doorstate.jobs import Progress, default_workers, no_progress, piece_paths, run_pieces
from doorstate.simulation.generate import Frame, Preset, SampleRow, pose_indices, simulate_pose
from doorstate.simulation.manifest import flatten, read_csv, write_csv
from doorstate.simulation.shading import shade

RawKind = Literal["pcd", "depth", "image"]
RAW_KINDS: tuple[RawKind, ...] = ("pcd", "depth", "image")
MANIFEST = "manifest.csv"
_SETTINGS = "simulation.json"
_POSES_PER_PIECE = 8


class SimulationSettings(BaseModel):
    """What was simulated; a folder is continued only with the same settings."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    preset: Preset
    seed: int
    poses: int | None
    raw: tuple[RawKind, ...] = ()


class _Piece(NamedTuple):
    settings: SimulationSettings
    indices: list[int]
    folder: Path


def simulate_dataset(
    folder: Path,
    settings: SimulationSettings,
    workers: int | None = None,
    progress: Progress = no_progress,
) -> list[dict[str, str]]:
    """Simulate into `folder`, going on where a killed run stopped.

    Returns:
        The manifest's rows.

    Raises:
        ConfigError: the folder holds something else.
    """
    _claim(folder, settings)
    manifest, scratch = folder / MANIFEST, folder / "pieces"
    if manifest.exists():
        shutil.rmtree(scratch, ignore_errors=True)
        progress(1, 1)
        return read_csv(manifest)
    indices = pose_indices(settings.poses)
    pieces = [
        _Piece(settings, indices[start : start + _POSES_PER_PIECE], folder)
        for start in range(0, len(indices), _POSES_PER_PIECE)
    ]
    paths = piece_paths(scratch, len(pieces), ".csv")
    run_pieces(_simulate_piece, pieces, paths, workers or default_workers(), progress)
    rows = [row for path in paths for row in read_csv(path)]
    write_csv(manifest, rows)
    shutil.rmtree(scratch)
    return rows


def read_settings(folder: Path) -> SimulationSettings:
    """What a simulated folder holds.

    Raises:
        DatasetError: it is no simulated folder, or its settings file is damaged.
    """
    path = folder / _SETTINGS
    try:
        return SimulationSettings.model_validate_json(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise DatasetError(f"{folder}: holds no {_SETTINGS}; make one with 'doorstate simulate'") from error
    except ValidationError as error:
        raise DatasetError(f"{path}: {error.errors()[0]['msg']}") from error


def is_simulated(folder: Path) -> bool:
    """Whether `folder` was written by `simulate_dataset`."""
    return (folder / _SETTINGS).is_file()


def _claim(folder: Path, settings: SimulationSettings) -> None:
    if is_simulated(folder):
        if read_settings(folder) != settings:
            raise ConfigError(f"{folder}: holds a simulation with other settings; choose another folder")
        return
    if not is_vacant(folder):
        raise ConfigError(f"{folder}: exists and holds something else; choose another folder")
    write_text(folder / _SETTINGS, json.dumps(settings.model_dump(), indent=2) + "\n")


def _simulate_piece(piece: _Piece, path: Path) -> None:
    rows: list[SampleRow] = []
    for index in piece.indices:
        pose_rows, frames = simulate_pose(piece.settings.preset, piece.settings.seed, index)
        for row, frame in zip(pose_rows, frames, strict=True):
            _write_raw(piece.folder, row, frame, piece.settings.raw)
        rows += pose_rows
    write_csv(path, [flatten(row) for row in rows])


def _write_raw(folder: Path, row: SampleRow, frame: Frame, kinds: Iterable[RawKind]) -> None:
    # One folder per state: the layout that `doorstate prepare` takes from anybody.
    for kind in kinds:
        if kind == "pcd":
            write_pcd(folder / "pcd" / row.state / f"{row.sample_id}.pcd", frame.points)
            continue
        if kind == "depth":
            millimetres = np.nan_to_num(frame.cut.depth_m * 1000).round().astype(np.uint16)
            picture = Image.fromarray(millimetres)
        else:
            picture = Image.fromarray(shade(frame.full, row.camera.intrinsics()))
        with atomic_path(folder / kind / row.state / f"{row.sample_id}.png") as temporary:
            picture.save(temporary)
