# SPDX-License-Identifier: Apache-2.0
"""Evaluation of recorded frames in pieces, by several processes or machines."""

from __future__ import annotations

import pickle
import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from doorstate._files import atomic_path
from doorstate._jobs import Engine, Progress, no_progress, piece_paths, run_pieces
from doorstate.dataset.labelled import LabelledFrame
from doorstate.evaluation.frames import FrameResults, Predictors, evaluate_frames
from doorstate.inference.backends.threads import configure_torch
from doorstate.inference.predictor import Predictor

_FRAMES_PER_PIECE = 16


class PredictorArguments(NamedTuple):
    """Methods that every process loads for itself."""

    by_name: Mapping[str, Mapping[str, Any]]  # arguments of `Predictor.load`
    threads: int = 1

    def load(self) -> Predictors:
        """Load the methods, and set the threads of the process."""
        configure_torch(self.threads, used=any(_uses_torch(options) for options in self.by_name.values()))
        return {
            name: Predictor.load(**options, threads=self.threads) for name, options in self.by_name.items()
        }


class _Piece(NamedTuple):
    methods: bytes  # pickled, by which a process knows those that it has loaded
    frames: Sequence[LabelledFrame]


def evaluate_frames_in_pieces(
    methods: PredictorArguments,
    frames: Sequence[LabelledFrame],
    engine: Engine,
    folder: Path | None = None,
    progress: Progress = no_progress,
) -> FrameResults:
    """Return what `evaluate_frames` does, in the order of the frames.

    Args:
        methods: networks and rules.
        frames: labelled frames.
        engine: runs the pieces.
        folder: folder for temporary files, which all machines share; None is that of this machine.
        progress: called with pieces done and pieces in all.
    """
    pickled = pickle.dumps(methods)
    pieces = [
        _Piece(pickled, frames[start : start + _FRAMES_PER_PIECE])
        for start in range(0, len(frames), _FRAMES_PER_PIECE)
    ]
    with tempfile.TemporaryDirectory(prefix=".doorstate-", dir=folder) as scratch:
        paths = piece_paths(Path(scratch), len(pieces), ".pickle")
        run_pieces(_evaluate_piece, pieces, paths, engine, progress)
        # Written just now by this program, in a folder that only its user may write.
        parts: list[FrameResults] = [pickle.loads(path.read_bytes()) for path in paths]
    return FrameResults(
        tuple(frame for part in parts for frame in part.frames),
        {name: tuple(found for part in parts for found in part.outputs[name]) for name in methods.by_name},
        tuple(pair for part in parts for pair in part.unreadable),
    )


def _evaluate_piece(piece: _Piece, path: Path) -> None:
    results = evaluate_frames(_loaded(piece.methods), piece.frames)
    with atomic_path(path, durable=False) as temporary:
        temporary.write_bytes(pickle.dumps(results))


@lru_cache(maxsize=1)
def _loaded(methods: bytes) -> Predictors:
    load: Callable[[], Predictors] = pickle.loads(methods).load
    return load()


def _uses_torch(options: Mapping[str, Any]) -> bool:
    return options.get("device", "cpu") != "cpu" or str(options.get("name_or_path")).endswith(".safetensors")
