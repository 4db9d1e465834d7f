# SPDX-License-Identifier: Apache-2.0
"""Simulation and preparation in one pass, which renders every frame once; the result equals that of two passes."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from doorstate._jobs import Progress, WorkersOrEngine, no_progress
from doorstate._locks import owned_folder
from doorstate.dataset.pieces import PieceClouds
from doorstate.dataset.preparation import Preparation
from doorstate.dataset.prepare import PreparationSummary, assemble, prepare_dataset
from doorstate.dataset.sampling import samples_of_frame
from doorstate.dataset.store import is_prepared
from doorstate.simulation.frames import Frame
from doorstate.simulation.row import Row
from doorstate.simulation.settings import SimulationSettings
from doorstate.simulation.writer import piece_names, simulate_dataset


@dataclass(frozen=True)
class Sampler:
    """Callback of the simulation that samples the frames of every piece and saves their clouds."""

    preparation: Preparation

    @property
    def scratch(self) -> Path:
        """Folder of the clouds until all pieces are done."""
        spec = self.preparation.spec
        settings = [spec.num_points, spec.max_depth_m, spec.thin, spec.remove_outliers]
        if self.preparation.crops is not None:
            settings += self.preparation.crops.model_dump().values()
        return self.preparation.source / f"sampled-{'-'.join(map(str, settings))}"

    def path(self, piece: str) -> Path:
        """Return the file of the clouds of a piece."""
        return self.scratch / f"{piece}.npz"

    def __call__(self, piece: str, samples: Iterable[tuple[Row, Frame]]) -> None:
        """Sample the frames of a piece, and save their clouds."""
        spec = self.preparation.spec
        clouds = PieceClouds(spec.num_points)
        for row, frame in samples:
            clouds.add(samples_of_frame(row, frame, spec, self.preparation.crops))
        clouds.save(self.path(piece))


def simulate_prepared(
    settings: SimulationSettings,
    preparation: Preparation,
    folder: Path,
    workers: WorkersOrEngine = None,
    progress: Progress = no_progress,
) -> PreparationSummary:
    """Simulate into `preparation.source` and prepare into `folder`, continuing where a killed run or shards stopped.

    If the simulation exists already, or was started without this step, its frames are rendered again.

    Args:
        settings: settings of the simulation.
        preparation: preparation of the clouds.
        folder: output folder of the prepared data set.
        workers: processes, None is one per processor; or an engine.
        progress: called with pieces of the simulation done and pieces in all.

    Raises:
        ConfigError: a folder holds something else.
        DatasetError: none of the clouds could be prepared.
        FolderInUseError: another process works in a folder.
    """
    sampler = Sampler(preparation)
    with owned_folder(preparation.source), owned_folder(folder):
        simulate_dataset(preparation.source, settings, workers, progress, sampler)
        paths = [sampler.path(piece) for piece in piece_names(settings)]
        if is_prepared(folder) or not all(path.is_file() for path in paths):
            summary = prepare_dataset(preparation, folder, workers, progress)
        else:
            rows = preparation.rows()
            preparation.claim(folder, rows)
            summary = assemble(rows, preparation, folder, paths)
        shutil.rmtree(sampler.scratch, ignore_errors=True)
        return summary
