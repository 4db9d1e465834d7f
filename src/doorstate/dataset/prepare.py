# SPDX-License-Identifier: Apache-2.0
"""From raw samples, simulated or somebody's files, to a prepared data set; resumable, several processes."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate import __version__
from doorstate._files import atomic_path, is_vacant, read_csv, write_csv, write_text
from doorstate._jobs import Progress, Shard, default_workers, no_progress, piece_paths, run_pieces
from doorstate.clouds.preparation import CloudSpec
from doorstate.dataset.class_folders import labelled_rows
from doorstate.dataset.layouts import find_layout
from doorstate.dataset.sampled import exactly, sample_frame
from doorstate.dataset.store import (
    CLOUDS,
    DESCRIPTION,
    MANIFEST,
    PARTS,
    DatasetDescription,
    PreparedDataset,
    open_dataset,
)
from doorstate.dataset.strata import distance_band, region
from doorstate.errors import CameraError, CloudError, ConfigError, DatasetError
from doorstate.io.options import ReadOptions
from doorstate.io.readers import read_cloud
from doorstate.simulation.frames import depth_sha256, replay
from doorstate.simulation.manifest import unflatten
from doorstate.simulation.writer import MANIFEST as SIMULATED_MANIFEST
from doorstate.simulation.writer import is_simulated, read_settings
from doorstate.types import Points

REJECTED = "rejected.csv"
_SCRATCH = "pieces"
_CLAIM = "preparation.json"
_SAMPLES_PER_PIECE = 24


class PreparationSummary(NamedTuple):
    """What a preparation made."""

    dataset: PreparedDataset
    rejected: list[dict[str, str]]  # sample_id, file, reason


class Preparation(NamedTuple):
    """What is prepared, and how."""

    source: Path  # a simulated folder, class folders of clouds, or a `layout`
    spec: CloudSpec = CloudSpec()  # of every cloud
    poses_csv: Path | None = None  # distances and angles of class folders (`dataset.class_folders`)
    options: ReadOptions = ReadOptions()  # what the files do not say of themselves
    layout: str | None = None  # of another's folders (`dataset.layouts`)

    @property
    def simulated(self) -> bool:
        """Whether the source is of the simulator."""
        return self.layout is None and is_simulated(self.source)

    def rows(self) -> list[dict[str, str]]:
        """A line for each sample, in their order.

        Raises:
            ConfigError: the source knows what the options say.
            DatasetError: there is none.
        """
        if self.layout is not None:
            return find_layout(self.layout).rows(self.source)
        if not self.simulated:
            return labelled_rows(self.source, self.poses_csv)
        if self.poses_csv is not None or self.options != ReadOptions():
            raise ConfigError(
                f"{self.source}: is simulated and knows its poses and its camera: leave their options out"
            )
        return _simulated_rows(self.source)

    def to_json(self, rows: Sequence[dict[str, str]]) -> str:
        """What a folder is claimed with; folders begun by older versions hold the same."""
        settings = {
            "source": str(self.source.resolve()),
            "num_points": self.spec.num_points,
            "options": repr(self.options),
            "rows": hashlib.sha256(json.dumps(rows).encode()).hexdigest(),
            **({} if self.layout is None else {"layout": self.layout}),
            **({} if self.spec.max_depth_m is None else {"max_depth_m": self.spec.max_depth_m}),
            **({"thin": True} if self.spec.thin else {}),
        }
        return json.dumps(settings, indent=2) + "\n"


class _Piece(NamedTuple):
    asked: Preparation
    rows: list[dict[str, str]]


def prepare_dataset(
    asked: Preparation, folder: Path, workers: int | None = None, progress: Progress = no_progress
) -> PreparationSummary:
    """Prepare clouds into `folder`, all of the same size.

    A cloud with fewer than `num_points` distinct points, or that cannot be read, is left out and listed in
    `rejected.csv` with the reason.

    Args:
        asked: what is prepared, and how.
        folder: where to; what a killed preparation or shards of it have begun is continued.
        workers: processes; None is one per processor.
        progress: called with pieces done and pieces in all.

    Raises:
        ConfigError: `folder` holds something prepared from another source or with other settings.
        DatasetError: nothing to prepare, or nothing could be prepared.
    """
    pieces, paths = _plan(asked, folder)
    if (folder / DESCRIPTION).exists():
        shutil.rmtree(folder / _SCRATCH, ignore_errors=True)
        progress(1, 1)
        rejected = read_csv(folder / REJECTED) if (folder / REJECTED).exists() else []
        return PreparationSummary(open_dataset(folder), rejected)
    run_pieces(_prepare_piece, pieces, paths, workers or default_workers(), progress)
    return finish([row for piece in pieces for row in piece.rows], asked, folder, paths)


def finish(
    rows: list[dict[str, str]], asked: Preparation, folder: Path, paths: Sequence[Path]
) -> PreparationSummary:
    """Make a claimed folder the data set of rows whose clouds lie in `paths`, files of `write_clouds`.

    Raises:
        DatasetError: nothing could be prepared.
    """
    reasons = _reasons(paths)
    if all(reasons):
        _release(folder)
        raise DatasetError(f"none of the {len(rows)} clouds could be prepared; the first: {reasons[0]}")
    rejected = _assemble(folder, asked, rows, paths, reasons)
    name = read_settings(asked.source).preset.name if asked.simulated else asked.source.resolve().name
    DatasetDescription(
        kind="simulated" if asked.simulated else "imported",
        source=name,
        **asked.spec.model_dump(),
        samples=len(rows) - len(rejected),
        doorstate_version=__version__,
    ).save(folder)
    shutil.rmtree(folder / _SCRATCH, ignore_errors=True)
    return PreparationSummary(open_dataset(folder), rejected)


def prepare_shard(
    asked: Preparation,
    folder: Path,
    shard: Shard,
    workers: int | None = None,
    progress: Progress = no_progress,
) -> None:
    """Prepare the pieces of one shard; `prepare_dataset` of the same joins them when all are done.

    Raises:
        ConfigError: `folder` holds something prepared from another source or with other settings.
        DatasetError: nothing to prepare.
    """
    pieces, paths = _plan(asked, folder)
    if (folder / DESCRIPTION).exists():
        progress(1, 1)
        return
    run_pieces(_prepare_piece, shard.of(pieces), shard.of(paths), workers or default_workers(), progress)


def _plan(asked: Preparation, folder: Path) -> tuple[list[_Piece], list[Path]]:
    """Claim the folder, and say what is to be done and where it goes."""
    rows = asked.rows()
    claim(folder, asked.to_json(rows))
    pieces = [
        _Piece(asked, rows[start : start + _SAMPLES_PER_PIECE])
        for start in range(0, len(rows), _SAMPLES_PER_PIECE)
    ]
    return pieces, piece_paths(folder / _SCRATCH, len(pieces), ".npz")


def _simulated_rows(source: Path) -> list[dict[str, str]]:
    if not (source / SIMULATED_MANIFEST).exists():
        raise DatasetError(
            f"{source}: the simulation is not complete; run 'doorstate simulate' again to finish it"
        )
    rows = []
    for row in read_csv(source / SIMULATED_MANIFEST):
        sample = unflatten(row)
        rows.append(
            row
            | {"distance_band": distance_band(sample.distance_m), "region": region(sample.robot_angle_deg)}
        )
    return rows


def claim(folder: Path, text: str) -> None:
    """Mark a folder with what is prepared in it.

    Raises:
        ConfigError: it holds something else.
    """
    path = folder / _CLAIM
    if is_vacant(folder):
        write_text(path, text)
    elif not path.is_file():
        raise ConfigError(f"{folder}: exists and holds something else; choose another folder")
    # Also after writing: another shard may have claimed the folder at the same moment.
    if path.read_text(encoding="utf-8") != text:
        raise ConfigError(f"{folder}: holds a preparation of something else; choose another folder")


def _prepare_piece(piece: _Piece, path: Path) -> None:
    asked = piece.asked
    read = read_cloud if asked.layout is None else find_layout(asked.layout).read
    simulated = asked.simulated
    clouds: list[Points] = []
    parts: list[NDArray[np.uint8]] = []
    reasons: list[str] = []
    for row in piece.rows:
        try:
            if simulated:
                cloud, part = _from_simulation(row, asked)
                parts.append(part)
            else:
                raw = read(asked.source / row["file"], asked.options)
                cloud = exactly(raw, asked.spec).points
            clouds.append(cloud)
            reasons.append("")
        except (CloudError, CameraError) as error:
            reasons.append(error.describe(with_path=False))
    write_clouds(path, asked.spec.num_points, clouds, parts, reasons)


def write_clouds(
    path: Path,
    num_points: int,
    clouds: Sequence[Points],
    parts: Sequence[NDArray[np.uint8]],
    reasons: Sequence[str],
) -> None:
    """Write the clouds of some samples, their parts where known, and for each why it was left out, or nothing."""
    with atomic_path(path) as temporary:
        np.savez(
            temporary,
            clouds=np.array(clouds, dtype=np.float32).reshape(-1, num_points, 3),
            parts=np.array(parts, dtype=np.uint8).reshape(-1, num_points),
            reasons=np.array(reasons, dtype=str),
        )


def _from_simulation(row: dict[str, str], asked: Preparation) -> tuple[Points, NDArray[np.uint8]]:
    sample = unflatten(row)
    frame = replay(sample)
    if depth_sha256(frame) != sample.depth_sha256:
        raise DatasetError(
            f"{sample.sample_id}: renders differently than its manifest says; simulate it again here"
        )
    return sample_frame(frame, asked.spec)


def _release(folder: Path) -> None:
    """Leave nothing of a preparation that made nothing: with better options the same folder is asked for again."""
    shutil.rmtree(folder / _SCRATCH, ignore_errors=True)
    (folder / _CLAIM).unlink()
    if is_vacant(folder):
        shutil.rmtree(folder)


def _reasons(paths: Sequence[Path]) -> list[str]:
    """Why each cloud was left out, or nothing."""
    reasons: list[str] = []
    for path in paths:
        with np.load(path, allow_pickle=False) as piece:
            reasons += [str(reason) for reason in piece["reasons"]]
    return reasons


def _assemble(
    folder: Path, asked: Preparation, rows: list[dict[str, str]], paths: Sequence[Path], reasons: list[str]
) -> list[dict[str, str]]:
    kept = [row for row, reason in zip(rows, reasons, strict=True) if not reason]
    rejected = [
        {"sample_id": row["sample_id"], "file": row.get("file", ""), "reason": reason}
        for row, reason in zip(rows, reasons, strict=True)
        if reason
    ]
    if rejected:
        write_csv(folder / REJECTED, rejected)
    _concatenate(folder / CLOUDS, paths, "clouds", (len(kept), asked.spec.num_points, 3), np.float32)
    if asked.simulated:
        _concatenate(folder / PARTS, paths, "parts", (len(kept), asked.spec.num_points), np.uint8)
    write_csv(folder / MANIFEST, kept)
    return rejected


def _concatenate(target: Path, paths: Sequence[Path], name: str, shape: tuple[int, ...], dtype: type) -> None:
    with atomic_path(target) as temporary:
        whole = np.lib.format.open_memmap(temporary, mode="w+", dtype=dtype, shape=shape)
        start = 0
        for path in paths:
            with np.load(path, allow_pickle=False) as piece:
                part = piece[name]
            whole[start : start + len(part)] = part
            start += len(part)
        whole.flush()
        del whole
