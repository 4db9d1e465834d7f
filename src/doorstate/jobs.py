# SPDX-License-Identifier: Apache-2.0
"""Long work in resumable pieces: each piece writes one file, whole or not at all, in any order, in any process."""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import TypeVar

Piece = TypeVar("Piece")
Progress = Callable[[int, int], None]  # (pieces done, pieces in all)


def no_progress(done: int, total: int) -> None:
    """Report nothing."""


def default_workers() -> int:
    """One process per processor this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def piece_paths(folder: Path, count: int, suffix: str) -> list[Path]:
    """Where the pieces of a job lie."""
    return [folder / f"{number:05d}{suffix}" for number in range(count)]


def run_pieces(
    work: Callable[[Piece, Path], None],
    pieces: Sequence[Piece],
    paths: Sequence[Path],
    workers: int,
    progress: Progress = no_progress,
) -> None:
    """Call `work(piece, path)` for every piece whose file is missing; a killed run goes on where it was.

    `work` must be a top-level function that writes `path` atomically. Its first error stops the job as soon as the
    pieces in work are done; finished pieces stay.
    """
    missing = [(piece, path) for piece, path in zip(pieces, paths, strict=True) if not path.exists()]
    done = len(pieces) - len(missing)
    progress(done, len(pieces))
    if workers <= 1 or len(missing) <= 1:
        for piece, path in missing:
            work(piece, path)
            done += 1
            progress(done, len(pieces))
        return
    # spawn: a forked child of a process that runs torch or BLAS threads can hang.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(workers, len(missing)), context, _end_with_parent) as pool:
        futures = [pool.submit(work, piece, path) for piece, path in missing]
        try:
            for future in as_completed(futures):
                future.result()
                done += 1
                progress(done, len(pieces))
        except BaseException:
            # A second shutdown, by the with block, would not wait: workers would go on writing after the return.
            pool.shutdown(cancel_futures=True)
            raise


def _end_with_parent() -> None:
    """Let a worker end at once when its parent is killed: an orphan would go on writing beside the restarted job."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
