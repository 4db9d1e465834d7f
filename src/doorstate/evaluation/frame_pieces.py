# SPDX-License-Identifier: Apache-2.0
"""Evaluation of recorded frames in pieces, by several processes or machines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from doorstate._jobs import Progress, Resources, WorkersOrEngine, map_pieces, no_progress
from doorstate.dataset.labelled import LabelledFrame
from doorstate.evaluation.frames import FrameResults, Predictors, evaluate_frames
from doorstate.inference.backends import needs_torch
from doorstate.inference.backends.threads import configure_torch
from doorstate.inference.predictor import Predictor

_FRAMES_PER_PIECE = 16


class PredictorArguments(NamedTuple):
    """Methods that every process loads for itself."""

    by_name: Mapping[str, Mapping[str, Any]]  # arguments of `Predictor.load`
    threads: int = 1

    def load(self) -> Predictors:
        """Load the methods, and set the threads of the process."""
        networks = [options for options in self.by_name.values() if "rule" not in options]
        used = any(
            needs_torch(options["name_or_path"], device=options.get("device", "cpu")) for options in networks
        )
        configure_torch(self.threads, used=used)
        return {
            name: Predictor.load(**options, threads=self.threads) for name, options in self.by_name.items()
        }


def evaluate_frames_in_pieces(
    methods: PredictorArguments,
    frames: Sequence[LabelledFrame],
    workers: WorkersOrEngine,
    folder: Path | None = None,
    progress: Progress = no_progress,
    resources: Resources | None = None,
) -> FrameResults:
    """Return what `evaluate_frames` does, in the order of the frames.

    Args:
        methods: networks and rules.
        frames: labelled frames.
        workers: number of processes on this machine, None for one a processor, or an engine.
        folder: folder for temporary files, as for `map_pieces`.
        progress: called with pieces done and pieces in all.
        resources: needs of each piece.
    """
    starts = range(0, len(frames), _FRAMES_PER_PIECE)
    pieces = [frames[start : start + _FRAMES_PER_PIECE] for start in starts]
    parts = map_pieces(evaluate_frames, methods.load, pieces, workers, folder, progress, resources)
    return FrameResults(
        tuple(frame for part in parts for frame in part.frames),
        {name: tuple(found for part in parts for found in part.outputs[name]) for name in methods.by_name},
        tuple(pair for part in parts for pair in part.unreadable),
    )
