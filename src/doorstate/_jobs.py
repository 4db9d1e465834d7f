# SPDX-License-Identifier: Apache-2.0
"""Resumable jobs in pieces: each piece writes one file atomically, in any order, in any process."""

from __future__ import annotations

import multiprocessing
import os
import re
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple, Self, TypeVar

from doorstate._files import remove_scratch
from doorstate.errors import ConfigError, RunError

Piece = TypeVar("Piece")
Progress = Callable[[int, int], None]  # (pieces done, total)


class Shard(NamedTuple):
    """One of `shards` equal parts of a job; `number` counts from 1."""

    number: int
    shards: int

    @classmethod
    def parse(cls, text: str) -> Self:
        """Parse text such as `2/8`.

        Raises:
            ConfigError: the text has another form, or there is no such shard.
        """
        match = re.fullmatch(r"([0-9]{1,6})/([0-9]{1,6})", text)
        shard = cls(*(int(digits) for digits in match.groups())) if match else cls(0, 0)
        if not 1 <= shard.number <= shard.shards:
            raise ConfigError(f"{text!r} is not a shard", field="shard", expected="number/count, such as 2/8")
        return shard

    @property
    def name(self) -> str:
        """Name for files, such as `2-of-8`."""
        return f"{self.number}-of-{self.shards}"

    def select(self, pieces: Sequence[Piece]) -> Sequence[Piece]:
        """Return every `shards`-th piece, so that all shards take about as long."""
        return pieces[self.number - 1 :: self.shards]


def no_progress(done: int, total: int) -> None:
    """Report nothing."""


def default_workers() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def piece_paths(folder: Path, count: int, suffix: str) -> list[Path]:
    """Return the files of the pieces of a job."""
    return [folder / f"{number:05d}{suffix}" for number in range(count)]


def run_pieces(
    work: Callable[[Piece, Path], None],
    pieces: Sequence[Piece],
    paths: Sequence[Path],
    workers: int,
    progress: Progress = no_progress,
) -> None:
    """Call `work(piece, path)` for every piece whose file is missing, so that an interrupted job continues.

    `work` must be a top-level function that writes `path` atomically. After its first error the job stops as soon as
    the running pieces are done, after an interrupt at once; finished pieces are kept.
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
    worker_end, parent_end = context.Pipe(duplex=False)
    with (
        closing(parent_end),
        closing(worker_end),
        ProcessPoolExecutor(min(workers, len(missing)), context, _end_with_parent, (worker_end,)) as pool,
    ):
        try:
            with interrupts_blocked():
                futures = [pool.submit(work, piece, path) for piece, path in missing]
            for future in as_completed(futures):
                future.result()
                done += 1
                progress(done, len(pieces))
        except BaseException as error:
            if not isinstance(error, Exception):
                parent_end.close()
            # The with block alone would not wait for the workers, which would continue to write after the return.
            pool.shutdown(cancel_futures=True)
            for _, path in missing:
                remove_scratch(path)
            if isinstance(error, BrokenProcessPool):
                raise RunError(
                    "a worker process was killed, perhaps for lack of memory",
                    hint="run again with fewer processes: finished pieces are kept",
                ) from error
            raise


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Block SIGINT in processes that are started within the block, from their first moment on.

    The parent handles Ctrl-C, which a terminal sends to its workers too; those that import would print tracebacks.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_with_parent(parent: Connection) -> None:
    """End a worker when its parent is killed or stopped: an orphan would write beside the restarted job.

    Args:
        parent: connection that the parent holds open; no lock, which a killed worker would keep.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # where it is not blocked

    def watch() -> None:
        parent.poll(None)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
