# SPDX-License-Identifier: Apache-2.0
"""Preparation of data sets from simulations or recorded clouds; resumable, in several processes."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from doorstate import __version__
from doorstate._files import is_vacant, read_csv, write_csv
from doorstate._jobs import Progress, Shard, WorkersOrEngine, no_progress, piece_paths, run_pieces
from doorstate._locks import owned_folder
from doorstate._paths import check_encoding, csv_name
from doorstate.dataset.description import DESCRIPTION_FILE, DatasetDescription
from doorstate.dataset.frame_index import IndexedOptions
from doorstate.dataset.layouts import find_layout
from doorstate.dataset.pieces import PieceClouds, SavedPieces
from doorstate.dataset.preparation import CLAIM, Preparation
from doorstate.dataset.sampling import rejected_sample, samples_of_frame, samples_of_recording
from doorstate.dataset.store import CLOUDS_FILE, PARTS_FILE, PreparedDataset, open_dataset
from doorstate.errors import CameraError, CloudError, DatasetError
from doorstate.io.readers import read_cloud
from doorstate.simulation.frames import Frame, depth_sha256, replay
from doorstate.simulation.manifest import MANIFEST_FILE, unflatten
from doorstate.simulation.row import Row

REJECTED = "rejected.csv"
_PIECES = "pieces"
_SAMPLES_PER_PIECE = 24


class PreparationSummary(NamedTuple):
    """A prepared data set and the samples that were left out."""

    dataset: PreparedDataset
    rejected: list[dict[str, str]]  # sample_id, file, reason


class _Piece(NamedTuple):
    preparation: Preparation
    rows: list[dict[str, str]]


def prepare_dataset(
    preparation: Preparation, folder: Path, workers: WorkersOrEngine = None, progress: Progress = no_progress
) -> PreparationSummary:
    """Prepare clouds of one size into `folder`, continuing where a killed run or shards of it stopped.

    Clouds that cannot be read, or have fewer distinct points than needed, are left out and listed in `rejected.csv`
    with the reason.

    Args:
        preparation: source and settings.
        folder: output folder.
        workers: processes, None is one per processor; or an engine.
        progress: called with pieces done and pieces in all.

    Raises:
        ConfigError: `folder` holds something else.
        DatasetError: the source is empty, or none of its clouds could be prepared.
        FolderInUseError: another process works in `folder`.
    """
    with owned_folder(folder):
        pieces, paths = _claim(preparation, folder)
        if (folder / DESCRIPTION_FILE).exists():
            shutil.rmtree(folder / _PIECES, ignore_errors=True)
            progress(1, 1)
            rejected = read_csv(folder / REJECTED) if (folder / REJECTED).exists() else []
            return PreparationSummary(open_dataset(folder), rejected)
        run_pieces(_prepare_piece, pieces, paths, workers, progress)
        return assemble([row for piece in pieces for row in piece.rows], preparation, folder, paths)


def prepare_shard(
    preparation: Preparation,
    folder: Path,
    shard: Shard,
    workers: WorkersOrEngine = None,
    progress: Progress = no_progress,
) -> None:
    """Prepare the pieces of one shard; `prepare_dataset` joins them when all shards are done.

    Raises:
        ConfigError: `folder` holds something else.
        DatasetError: the source is empty.
        FolderInUseError: another process works in `folder`, or on this shard of it.
    """
    with owned_folder(folder, shard.name):
        pieces, paths = _claim(preparation, folder)
        if (folder / DESCRIPTION_FILE).exists():
            progress(1, 1)
            return
        run_pieces(_prepare_piece, shard.select(pieces), shard.select(paths), workers, progress)


def assemble(
    rows: list[dict[str, str]], preparation: Preparation, folder: Path, paths: Sequence[Path]
) -> PreparationSummary:
    """Complete a claimed folder from the rows and the files of their clouds (`PieceClouds`).

    Raises:
        DatasetError: none of the clouds could be prepared.
    """
    saved = SavedPieces.read(paths)
    kept, rejected = saved.lines(rows)
    if not kept:
        _release(folder)
        raise DatasetError(
            f"none of the {len(rows)} clouds could be prepared; the first: {rejected[0]['reason']}"
        )
    if rejected:
        write_csv(
            folder / REJECTED, [{name: csv_name(text) for name, text in row.items()} for row in rejected]
        )
    saved.join_clouds(folder / CLOUDS_FILE, preparation.spec.num_points)
    if preparation.is_simulated:
        saved.join_parts(folder / PARTS_FILE, preparation.spec.num_points)
    write_csv(folder / MANIFEST_FILE, kept)
    DatasetDescription(
        kind="simulated" if preparation.is_simulated else "imported",
        source=preparation.source_name,
        **preparation.spec.model_dump(),
        crops=preparation.crops,
        left_out=saved.left_out(rows),
        samples=len(kept),
        doorstate_version=__version__,
    ).save(folder)
    shutil.rmtree(folder / _PIECES, ignore_errors=True)
    return PreparationSummary(open_dataset(folder), rejected)


def _claim(preparation: Preparation, folder: Path) -> tuple[list[_Piece], list[Path]]:
    """Mark the folder with the preparation, and return the pieces and their files."""
    rows = preparation.rows()
    preparation.claim(folder, rows)
    pieces = [
        _Piece(preparation, rows[start : start + _SAMPLES_PER_PIECE])
        for start in range(0, len(rows), _SAMPLES_PER_PIECE)
    ]
    return pieces, piece_paths(folder / _PIECES, len(pieces), ".npz")


def _release(folder: Path) -> None:
    """Remove all files of a preparation without result, so that the folder can be used with other options."""
    shutil.rmtree(folder / _PIECES, ignore_errors=True)
    (folder / CLAIM).unlink()
    if is_vacant(folder):
        shutil.rmtree(folder)


def _prepare_piece(piece: _Piece, path: Path) -> None:
    preparation = piece.preparation
    read = read_cloud if preparation.layout is None else find_layout(preparation.layout).read
    indexed = IndexedOptions(preparation.options)
    is_simulated = preparation.is_simulated
    spec, crops = preparation.spec, preparation.crops
    clouds = PieceClouds(spec.num_points)
    for line in piece.rows:
        if is_simulated:
            row = unflatten(line)
            clouds.add(samples_of_frame(row, _replay(row), spec, crops))
            continue
        try:
            check_encoding(line["file"])
            file = preparation.source / line["file"]
            options = indexed.of(file) if preparation.layout is None else preparation.options
            clouds.add(samples_of_recording(line, read(file, options), spec, crops))
        except (CloudError, CameraError) as error:
            clouds.add([rejected_sample(error)])
    clouds.save(path)


def _replay(row: Row) -> Frame:
    frame = replay(row)
    if depth_sha256(frame) != row.depth_sha256:
        raise DatasetError(
            f"{row.sample_id} renders to another image than its manifest records",
            field="depth_sha256",
            hint="simulate the data set again on this machine",
        )
    return frame
