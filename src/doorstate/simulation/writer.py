# SPDX-License-Identifier: Apache-2.0
"""Simulated data sets on disk: `simulation.json`, `manifest.csv`, and raw files on request.

The manifest is the data set: `frames.replay` rebuilds the cloud of a row. Raw clouds, depth images and pictures are for
other tools; an `index.csv` beside the depth images holds their camera and its tilt (`dataset.frame_index`).
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image
from pydantic import ValidationError

from doorstate._documents import read_json
from doorstate._files import atomic_path, is_vacant, read_csv, write_csv, write_text
from doorstate._input import MAX_SETTINGS_BYTES
from doorstate._jobs import Progress, Shard, WorkersOrEngine, no_progress, piece_paths, run_pieces
from doorstate._locks import owned_folder
from doorstate._memory import keep_freed_memory
from doorstate.errors import ConfigError, DatasetError, first_validation_error
from doorstate.io.find import INDEX_FILE
from doorstate.io.pcd import write_pcd
from doorstate.simulation.frames import Frame
from doorstate.simulation.manifest import MANIFEST_FILE, flatten, unflatten
from doorstate.simulation.row import Row
from doorstate.simulation.settings import RawKind, SimulationSettings
from doorstate.simulation.shading import shade

_SETTINGS = "simulation.json"
_PIECES = "pieces"
_POSES_PER_PIECE = 8

PieceCallback = Callable[[str, Iterable[tuple[Row, Frame]]], None]
"""Called with the name of every piece and its rows and frames, which are rendered as it takes them, in the process that
renders them; it must be picklable."""


class _Piece(NamedTuple):
    settings: SimulationSettings
    indices: list[int]
    folder: Path
    callback: PieceCallback | None


def simulate_dataset(
    folder: Path,
    settings: SimulationSettings,
    workers: WorkersOrEngine = None,
    progress: Progress = no_progress,
    callback: PieceCallback | None = None,
) -> list[dict[str, str]]:
    """Simulate into `folder`, continuing where a killed run or shards of it stopped.

    Args:
        folder: output folder.
        settings: preset, seed and extent of the data set.
        workers: processes, None is one per processor; or an engine.
        progress: called with pieces done and pieces in all.
        callback: called for every piece before it counts as done.

    Returns:
        The manifest's rows.

    Raises:
        ConfigError: the folder holds something else.
        FolderInUseError: another process works in it.
    """
    with owned_folder(folder):
        pieces, paths = _claim(folder, settings, callback)
        manifest, scratch = folder / MANIFEST_FILE, folder / _PIECES
        if manifest.exists():
            shutil.rmtree(scratch, ignore_errors=True)
            progress(1, 1)
            return read_csv(manifest)
        run_pieces(_simulate_piece, pieces, paths, workers, progress)
        rows = [row for path in paths for row in read_csv(path)]
        if "depth" in settings.raw:
            write_csv(folder / "depth" / INDEX_FILE, [_index_row(unflatten(row)) for row in rows])
        write_csv(manifest, rows)
        shutil.rmtree(scratch)
        return rows


def simulate_shard(
    folder: Path,
    settings: SimulationSettings,
    shard: Shard,
    workers: WorkersOrEngine = None,
    progress: Progress = no_progress,
    callback: PieceCallback | None = None,
) -> None:
    """Simulate the pieces of one shard into `folder`; `simulate_dataset` joins them when all shards are done.

    Shards may run at the same time in one folder, or in folders whose `pieces` are copied together later. Arguments
    are those of `simulate_dataset`.

    Raises:
        ConfigError: the folder holds something else.
        FolderInUseError: another process works in it.
    """
    with owned_folder(folder, shard.name):
        pieces, paths = _claim(folder, settings, callback)
        if (folder / MANIFEST_FILE).exists():
            progress(1, 1)
            return
        run_pieces(_simulate_piece, shard.select(pieces), shard.select(paths), workers, progress)


def read_settings(folder: Path) -> SimulationSettings:
    """Return the settings of a simulated folder.

    Raises:
        DatasetError: it is no simulated folder, or its settings file is damaged.
    """
    path = folder / _SETTINGS
    if not path.is_file():
        raise DatasetError(f"holds no {_SETTINGS}: it is no simulated data set", path=folder)
    try:
        return SimulationSettings.model_validate(read_json(path, DatasetError, MAX_SETTINGS_BYTES))
    except ValidationError as error:
        raise DatasetError(first_validation_error(error), path=path) from error


def piece_names(settings: SimulationSettings) -> list[str]:
    """Return the names of all pieces in order, as `PieceCallback` gets them."""
    return [path.stem for path in _pieces(Path(), settings, None)[1]]


def is_simulated(folder: Path) -> bool:
    """Return True if `folder` was written by `simulate_dataset`."""
    return (folder / _SETTINGS).is_file()


def _claim(
    folder: Path, settings: SimulationSettings, callback: PieceCallback | None
) -> tuple[list[_Piece], list[Path]]:
    """Mark the folder with the settings, and return the pieces and their files."""
    pieces = _pieces(folder, settings, callback)
    if is_vacant(folder):
        write_text(folder / _SETTINGS, json.dumps(settings.model_dump(), indent=2) + "\n")
    elif not is_simulated(folder):
        raise ConfigError("exists and holds something else", path=folder, hint="choose another folder")
    # Also after writing: another shard may have claimed the folder at the same moment.
    if read_settings(folder) != settings:
        raise ConfigError("holds a simulation with other settings", path=folder, hint="choose another folder")
    return pieces


def _pieces(
    folder: Path, settings: SimulationSettings, callback: PieceCallback | None
) -> tuple[list[_Piece], list[Path]]:
    indices = settings.indices()
    pieces = [
        _Piece(settings, indices[start : start + _POSES_PER_PIECE], folder, callback)
        for start in range(0, len(indices), _POSES_PER_PIECE)
    ]
    return pieces, piece_paths(folder / _PIECES, len(pieces), ".csv")


def _simulate_piece(piece: _Piece, path: Path) -> None:
    keep_freed_memory()  # images of a megabyte come and go
    rows: list[Row] = []

    def samples() -> Iterator[tuple[Row, Frame]]:
        for index in piece.indices:
            for row, frame in zip(*piece.settings.simulate(index), strict=True):
                _write_raw(piece.folder, row, frame, piece.settings.raw)
                rows.append(row)
                yield row, frame

    rest = samples()
    if piece.callback:
        piece.callback(path.stem, rest)
    for _ in rest:
        pass
    write_csv(path, [flatten(row) for row in rows])


def _index_row(row: Row) -> dict[str, str]:
    """Return the line of a depth image in the index, from which its cloud can be read as it was rendered."""
    camera, (pitch_deg, roll_deg) = row.camera.intrinsics(), row.told_tilt_deg()
    values = {
        "file": f"{row.state}/{row.sample_id}.png",
        "state": row.state,
        "width": camera.width,
        "height": camera.height,
        **{name: getattr(camera, name) for name in ("fx", "fy", "cx", "cy")},
        "depth_unit_m": 0.001,
        "roll_deg": roll_deg,
        "pitch_deg": pitch_deg,
    }
    if row.scene_id != row.pose_id and row.scene.door is not None:  # a door that several poses show
        values |= {
            "door": row.scene_id,
            "door_x_m": row.door_x_m,
            "door_y_m": row.door_y_m,
            "door_yaw_deg": row.door_yaw_deg,
            "door_width_m": row.opening_width_m,
            "door_floor_z_m": row.door_z_m,
        }
    return {name: str(value) for name, value in values.items()}


def _write_raw(folder: Path, row: Row, frame: Frame, kinds: Iterable[RawKind]) -> None:
    # One folder per state, the layout that `dataset.class_folders` reads.
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
