# SPDX-License-Identifier: Apache-2.0
"""Pieces in processes on this machine."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from itertools import islice
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Protocol

from doorstate._jobs.pieces import MAX_RETRIES, Work
from doorstate._jobs.resources import Resources, default_workers, pieces_on_this_machine, visible_gpus
from doorstate.errors import RunError

_QUEUED_PER_WORKER = 8


class _Slots(Protocol):
    """Queue of the GPUs of workers that start."""

    def get(self) -> str: ...
    def put(self, item: str) -> None: ...


class ProcessEngine:
    """Processes on this machine; one piece at a time is run in this process.

    Args:
        workers: pieces at the same time; None is one a processor, or as many as their resources allow. A number is
            lowered to what the resources of the pieces allow, where they are given.
    """

    def __init__(self, workers: int | None = None) -> None:
        self.workers = workers

    def at_once(self, resources: Resources | None) -> int:
        """Return the number of pieces that run at the same time.

        Raises:
            ConfigError: this machine does not have the resources of one piece.
        """
        if resources is None:
            return self.workers or default_workers()
        fitting = pieces_on_this_machine(resources)
        return min(self.workers or fitting, fitting)

    def threads(self, resources: Resources | None) -> int | None:
        """Return the threads of a piece: those asked for, else an equal share of the processors."""
        if resources is not None:
            return resources.cpus
        at_once = self.at_once(None)
        return max(1, default_workers() // at_once) if at_once > 1 else None

    def run(
        self,
        work: Work,
        missing: Sequence[tuple[Any, Path]],
        finished: Callable[[int], None],
        resources: Resources | None,
    ) -> None:
        """Run the pieces; see `Engine`.

        After a killed worker, the pieces that are left are run by half as many.

        Raises:
            RunError: workers were killed again and again.
        """
        at_once = min(self.at_once(resources), len(missing))
        if at_once <= 1:
            for piece, path in missing:
                work(piece, path)
                finished(1)
            return
        left = dict(enumerate(missing))
        for retries_left in reversed(range(MAX_RETRIES + 1)):
            try:
                _run_in_pool(work, left, at_once, resources, finished)
                return
            except BrokenProcessPool as error:
                if not retries_left:
                    raise RunError(
                        "worker processes were killed again and again, perhaps for lack of memory",
                        hint="run again with fewer processes: finished pieces are kept",
                    ) from error
                # A piece may have been finished by a worker that did not live to say so.
                done = [number for number, (_, path) in left.items() if path.exists()]
                for number in done:
                    del left[number]
                finished(len(done))
                at_once = max(1, at_once // 2)


def _run_in_pool(
    work: Work,
    left: dict[int, tuple[Any, Path]],
    workers: int,
    resources: Resources | None,
    finished: Callable[[int], None],
) -> None:
    """Run pieces in worker processes; those that are done leave `left`."""
    # spawn: a forked child of a process that runs torch or BLAS threads can hang.
    context = multiprocessing.get_context("spawn")
    worker_end, parent_end = context.Pipe(duplex=False)
    slots = _gpu_slots(context.SimpleQueue(), workers, resources)
    # Few are handed over at a time: a future takes more memory than a piece.
    waiting = iter([*left.items()])
    running: dict[Future[None], int] = {}
    with (
        closing(parent_end),
        closing(worker_end),
        ProcessPoolExecutor(workers, context, _start_worker, (worker_end, slots)) as pool,
    ):
        try:
            while True:
                with interrupts_blocked():
                    for number, piece in islice(waiting, _QUEUED_PER_WORKER * workers - len(running)):
                        running[pool.submit(work, *piece)] = number
                if not running:
                    return
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    number = running.pop(future)
                    future.result()
                    del left[number]
                    finished(1)
        except BaseException as error:
            if not isinstance(error, Exception):
                parent_end.close()
            # The with block alone would not wait for the workers, which would continue to write after the return.
            pool.shutdown(cancel_futures=True)
            raise


def _gpu_slots(queue: _Slots, workers: int, resources: Resources | None) -> _Slots | None:
    """Fill a queue with the GPUs of each worker; None: workers see what this process sees."""
    if resources is None or not resources.gpus:
        return None
    names = visible_gpus()
    for worker in range(workers):
        if resources.gpus <= 1:
            queue.put(names[worker // int(1 / resources.gpus + 1e-9)])
        else:
            whole = int(resources.gpus)
            queue.put(",".join(names[worker * whole : (worker + 1) * whole]))
    return queue


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


def _start_worker(parent: Connection, gpus: _Slots | None) -> None:
    """Give a worker its GPUs, and end it when its parent is killed or stopped.

    An orphan would write beside the restarted job.

    Args:
        parent: connection that the parent holds open; no lock, which a killed worker would keep.
        gpus: queue of the GPUs of each worker.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # where it is not blocked
    if gpus is not None:
        os.environ["CUDA_VISIBLE_DEVICES"] = gpus.get()

    def watch() -> None:
        parent.poll(None)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
