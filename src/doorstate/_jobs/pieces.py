# SPDX-License-Identifier: Apache-2.0
"""Contract of a job: a piece is done when its file is there, whole; order and place do not matter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeAlias, TypeVar

from doorstate._files import remove_scratch
from doorstate._jobs.resources import Resources

Piece = TypeVar("Piece")
Progress = Callable[[int, int], None]  # (pieces done, total)
Work: TypeAlias = Callable[[Any, Path], None]
MAX_RETRIES = 3  # of a piece whose process or machine was lost


class Engine(Protocol):
    """Runs pieces somewhere."""

    def run(
        self,
        work: Work,
        missing: Sequence[tuple[Any, Path]],
        finished: Callable[[int], None],
        resources: Resources | None,
    ) -> None:
        """Call `work(piece, path)` for every piece, in any order.

        The first error of a piece is raised once the running pieces are done; no other is started. An interrupt stops
        them at once. A piece whose process is lost is run again.

        Args:
            work: top-level function that writes `path` atomically.
            missing: pieces and their files.
            finished: called with the number of pieces that have been finished since the last call.
            resources: needs of each piece; None: one piece a processor.
        """

    def at_once(self, resources: Resources | None) -> int:
        """Return the number of pieces that run at the same time.

        Raises:
            ConfigError: not even one piece has room.
        """

    def threads(self, resources: Resources | None) -> int | None:
        """Return the number of threads of each piece; None: as many as libraries choose."""


WorkersOrEngine: TypeAlias = int | Engine | None
"""Number of processes on this machine, None for one a processor, or an engine."""


def no_progress(done: int, total: int) -> None:
    """Report nothing."""


def engine_of(workers: WorkersOrEngine) -> Engine:
    """Return the engine itself, or processes on this machine."""
    from doorstate._jobs.processes import ProcessEngine

    return ProcessEngine(workers) if workers is None or isinstance(workers, int) else workers


def piece_paths(folder: Path, count: int, suffix: str) -> list[Path]:
    """Return the files of the pieces of a job."""
    return [folder / f"{number:05d}{suffix}" for number in range(count)]


def run_pieces(
    work: Callable[[Piece, Path], None],
    pieces: Sequence[Piece],
    paths: Sequence[Path],
    workers: WorkersOrEngine = None,
    progress: Progress = no_progress,
    resources: Resources | None = None,
) -> None:
    """Call `work(piece, path)` for every piece whose file is missing, so that an interrupted job continues.

    `work` must be a top-level function that writes `path` atomically. After its first error the job stops as soon as
    the running pieces are done, after an interrupt at once; finished pieces are kept.

    Args:
        work: makes the file of a piece.
        pieces: pieces, which are sent to other processes.
        paths: file of each piece.
        workers: number of processes on this machine, None for one a processor, or an engine.
        progress: called with pieces done and pieces in all.
        resources: needs of each piece.
    """
    missing = [(piece, path) for piece, path in zip(pieces, paths, strict=True) if not path.exists()]
    done = len(pieces) - len(missing)
    progress(done, len(pieces))
    if not missing:
        return

    def finished(count: int) -> None:
        nonlocal done
        done += count
        progress(done, len(pieces))

    try:
        engine_of(workers).run(work, missing, finished, resources)
    except BaseException:
        remove_scratch([path for _, path in missing])
        raise
