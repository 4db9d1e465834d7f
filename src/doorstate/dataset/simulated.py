# SPDX-License-Identifier: Apache-2.0
"""Simulated and prepared in one pass, so that every frame is rendered once; what comes out is what two passes make."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from doorstate._jobs import Progress, no_progress
from doorstate.dataset.prepare import (
    Preparation,
    PreparationSummary,
    claim,
    finish,
    prepare_dataset,
    write_clouds,
)
from doorstate.dataset.sampled import sample_frame
from doorstate.dataset.store import is_prepared
from doorstate.errors import CloudError
from doorstate.simulation.frames import Frame
from doorstate.simulation.row import Row
from doorstate.simulation.settings import SimulationSettings
from doorstate.simulation.writer import piece_names, simulate_dataset
from doorstate.types import Points


@dataclass(frozen=True)
class Sampler:
    """Samples the frames of every piece as they are rendered: what `simulate_dataset` or a shard of it does besides."""

    asked: Preparation

    @property
    def scratch(self) -> Path:
        """Where the clouds of the pieces wait for the others."""
        spec = self.asked.spec
        return self.asked.source / f"sampled-{spec.num_points}-{spec.max_depth_m}-{spec.thin}"

    def path(self, piece: str) -> Path:
        """Of the clouds of a piece."""
        return self.scratch / f"{piece}.npz"

    def __call__(self, piece: str, rows: Sequence[Row], frames: Sequence[Frame]) -> None:
        """Sample the frames of a piece, and write their clouds."""
        clouds: list[Points] = []
        parts: list[NDArray[np.uint8]] = []
        reasons: list[str] = []
        for frame in frames:
            try:
                cloud, part = sample_frame(frame, self.asked.spec)
            except CloudError as error:
                reasons.append(str(error))
                continue
            clouds.append(cloud)
            parts.append(part)
            reasons.append("")
        write_clouds(self.path(piece), self.asked.spec.num_points, clouds, parts, reasons)


def simulate_prepared(
    settings: SimulationSettings,
    asked: Preparation,
    folder: Path,
    workers: int | None = None,
    progress: Progress = no_progress,
) -> PreparationSummary:
    """Simulate into `asked.source` and prepare into `folder`, going on where a killed run or shards of it stopped.

    Where the simulation is there already, or was begun without its clouds, those are rendered again.

    Args:
        settings: what is simulated.
        asked: how it is prepared.
        folder: where to.
        workers: processes; None is one per processor.
        progress: called with pieces done and pieces in all, of the simulation.

    Raises:
        ConfigError: a folder holds something else.
        DatasetError: nothing could be prepared.
    """
    sampler = Sampler(asked)
    simulate_dataset(asked.source, settings, workers, progress, sampler)
    paths = [sampler.path(piece) for piece in piece_names(settings)]
    if is_prepared(folder) or not all(path.is_file() for path in paths):
        summary = prepare_dataset(asked, folder, workers, progress)
    else:
        rows = asked.rows()
        claim(folder, asked.to_json(rows))
        summary = finish(rows, asked, folder, paths)
    shutil.rmtree(sampler.scratch, ignore_errors=True)
    return summary
