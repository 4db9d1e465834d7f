# SPDX-License-Identifier: Apache-2.0
"""Pieces whose results are wanted in this process, and not as files."""

from __future__ import annotations

import pickle
import shutil
import tempfile
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from doorstate._files import atomic_path
from doorstate._jobs.pieces import Piece, Progress, WorkersOrEngine, no_progress, piece_paths, run_pieces
from doorstate._jobs.resources import Resources

Shared = TypeVar("Shared")
Result = TypeVar("Result")
_PREFIX = ".pieces-"


class _Call(NamedTuple):
    work: Callable[[Any, Any], Any]
    load: Path
    piece: Any


def map_pieces(
    work: Callable[[Shared, Piece], Result],
    load: Callable[[], Shared],
    pieces: Sequence[Piece],
    workers: WorkersOrEngine = None,
    folder: Path | None = None,
    progress: Progress = no_progress,
    resources: Resources | None = None,
) -> list[Result]:
    """Return `work(load(), piece)` for every piece, in their order; each process calls `load` once.

    Results go through temporary files, so that an interrupted job begins again.

    Args:
        work: top-level function.
        load: function that can be pickled, and returns what all pieces need.
        pieces: pieces, which are sent to other processes.
        workers: number of processes on this machine, None for one a processor, or an engine.
        folder: folder for the temporary files, which this process owns and all machines share; None is that of this
            machine.
        progress: called with pieces done and pieces in all.
        resources: needs of each piece.
    """
    for left in [] if folder is None else folder.glob(f"{_PREFIX}*"):  # by killed programs
        shutil.rmtree(left, ignore_errors=True)
    with tempfile.TemporaryDirectory(prefix=_PREFIX, dir=folder) as scratch:
        shared = Path(scratch, "shared.pickle")
        _write(shared, load)
        calls = [_Call(work, shared, piece) for piece in pieces]
        paths = piece_paths(Path(scratch), len(pieces), ".pickle")
        try:
            run_pieces(_run, calls, paths, workers, progress, resources)
        finally:
            _loaded.cache_clear()
        # Written just now by this program, in a folder that only its user may write.
        return [pickle.loads(path.read_bytes()) for path in paths]


def _run(call: _Call, path: Path) -> None:
    _write(path, call.work(_loaded(call.load), call.piece))


def _write(path: Path, content: Any) -> None:
    with atomic_path(path, durable=False) as temporary:
        temporary.write_bytes(pickle.dumps(content))


@lru_cache(maxsize=1)
def _loaded(path: Path) -> Any:
    load: Callable[[], Any] = pickle.loads(path.read_bytes())
    return load()
