# SPDX-License-Identifier: Apache-2.0
"""A whole simulated data set on disk: `simulation.json`, `manifest.csv`, and raw files where they are asked for.

The manifest is the data set: a row rebuilds its cloud (frames.replay). Raw clouds, depth and pictures are for other
people's tools.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image
from pydantic import TypeAdapter, ValidationError

from doorstate._files import atomic_path, is_vacant, read_csv, write_csv, write_text
from doorstate._jobs import Progress, Shard, default_workers, no_progress, piece_paths, run_pieces
from doorstate.errors import ConfigError, DatasetError, first_validation_error
from doorstate.io.pcd import write_pcd
from doorstate.simulation.frames import Frame
from doorstate.simulation.manifest import Row, flatten
from doorstate.simulation.settings import RawKind, Settings
from doorstate.simulation.shading import shade

MANIFEST = "manifest.csv"
_SETTINGS = "simulation.json"
_PER_PIECE = 8
_ANY_SETTINGS: TypeAdapter[Settings] = TypeAdapter(Settings)


Also = Callable[[str, Sequence[Row], Sequence[Frame]], None]
"""What else is done with the rows and frames of a piece, by its name; it must be what another process can be sent."""


class _Piece(NamedTuple):
    settings: Settings
    indices: list[int]
    folder: Path
    also: Also | None


def simulate_dataset(
    folder: Path,
    settings: Settings,
    workers: int | None = None,
    progress: Progress = no_progress,
    also: Also | None = None,
) -> list[dict[str, str]]:
    """Simulate into `folder`, going on where a killed run or shards of it stopped.

    Args:
        folder: where to.
        settings: what is simulated.
        workers: processes; None is one per processor.
        progress: called with pieces done and pieces in all.
        also: called for every piece before it counts as done, in the process that has rendered it.

    Returns:
        The manifest's rows.

    Raises:
        ConfigError: the folder holds something else.
    """
    pieces, paths = _claim(folder, settings, also)
    manifest, scratch = folder / MANIFEST, folder / "pieces"
    if manifest.exists():
        shutil.rmtree(scratch, ignore_errors=True)
        progress(1, 1)
        return read_csv(manifest)
    run_pieces(_simulate_piece, pieces, paths, workers or default_workers(), progress)
    rows = [row for path in paths for row in read_csv(path)]
    write_csv(manifest, rows)
    shutil.rmtree(scratch)
    return rows


def simulate_shard(
    folder: Path,
    settings: Settings,
    shard: Shard,
    workers: int | None = None,
    progress: Progress = no_progress,
    also: Also | None = None,
) -> None:
    """Simulate the pieces of one shard into `folder`; `simulate_dataset` joins them when all shards are done.

    Shards may run at the same time in one folder, or in folders whose `pieces` are copied together later.

    Raises:
        ConfigError: the folder holds something else.
    """
    pieces, paths = _claim(folder, settings, also)
    if (folder / MANIFEST).exists():
        progress(1, 1)
        return
    run_pieces(_simulate_piece, shard.of(pieces), shard.of(paths), workers or default_workers(), progress)


def read_settings(folder: Path) -> Settings:
    """What a simulated folder holds.

    Raises:
        DatasetError: it is no simulated folder, or its settings file is damaged.
    """
    path = folder / _SETTINGS
    try:
        return _ANY_SETTINGS.validate_json(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise DatasetError(f"{folder}: holds no {_SETTINGS}; make one with 'doorstate simulate'") from error
    except ValidationError as error:
        raise DatasetError(f"{path}: {first_validation_error(error)}") from error


def piece_names(settings: Settings) -> list[str]:
    """What `also` hears the pieces called, in order."""
    return [path.stem for path in _pieces(Path(), settings, None)[1]]


def is_simulated(folder: Path) -> bool:
    """Whether `folder` was written by `simulate_dataset`."""
    return (folder / _SETTINGS).is_file()


def _claim(folder: Path, settings: Settings, also: Also | None) -> tuple[list[_Piece], list[Path]]:
    """Say what is to be done and where it goes, in a folder that is marked with it; not before that is known."""
    pieces = _pieces(folder, settings, also)
    if is_vacant(folder):
        write_text(folder / _SETTINGS, json.dumps(settings.model_dump(), indent=2) + "\n")
    elif not is_simulated(folder):
        raise ConfigError(f"{folder}: exists and holds something else; choose another folder")
    # Also after writing: another shard may have claimed the folder at the same moment.
    if read_settings(folder) != settings:
        raise ConfigError(f"{folder}: holds a simulation with other settings; choose another folder")
    return pieces


def _pieces(folder: Path, settings: Settings, also: Also | None) -> tuple[list[_Piece], list[Path]]:
    indices = settings.indices()
    pieces = [
        _Piece(settings, indices[start : start + _PER_PIECE], folder, also)
        for start in range(0, len(indices), _PER_PIECE)
    ]
    return pieces, piece_paths(folder / "pieces", len(pieces), ".csv")


def _simulate_piece(piece: _Piece, path: Path) -> None:
    rows: list[Row] = []
    kept: list[Frame] = []
    for index in piece.indices:
        new, frames = piece.settings.simulate(index)
        for row, frame in zip(new, frames, strict=True):
            _write_raw(piece.folder, row, frame, piece.settings.raw)
        rows += new
        kept += frames if piece.also else []
    if piece.also:
        piece.also(path.stem, rows, kept)
    write_csv(path, [flatten(row) for row in rows])


def _write_raw(folder: Path, row: Row, frame: Frame, kinds: Iterable[RawKind]) -> None:
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
