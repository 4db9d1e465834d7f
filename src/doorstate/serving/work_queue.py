# SPDX-License-Identifier: Apache-2.0
"""Files that wait for worker processes; large files have a worker of low priority to themselves."""

from __future__ import annotations

import asyncio
import queue
import threading
import time
from concurrent.futures import ThreadPoolExecutor

from fastapi import HTTPException

from doorstate.serving.limits import Limits
from doorstate.serving.worker import LOW_PRIORITY, Job, LoadPredictor, Method, Reply, Worker

_SLOW_S = 60.0
_TEXT = bytes([*range(32, 127), *b"\t\r\n"])
_TEXT_SAMPLE = 4096


class WorkQueue:
    """Worker processes and the files that wait for them, for one event loop.

    A large file takes long to read. It goes to one more worker, of low priority, so that any number of them slows the
    others by a few percent; so does a small file that turns out to take long. That worker starts with the first one.

    Args:
        load: loads the predictor, in each worker.
        limits: limits of the service.
    """

    def __init__(self, load: LoadPredictor, limits: Limits) -> None:
        self.limits = limits
        self._slow_until: dict[str, float] = {}  # by address
        self._quick = _Lane([Worker(load, limits) for _ in range(limits.workers)], limits.queue)
        self._large = _Lane([Worker(load, limits, LOW_PRIORITY)], max(1, limits.queue // 8))

    async def run(self, job: Job, client: str) -> Reply:
        """Return the reply of a worker.

        Args:
            job: file to predict.
            client: address of the client; after a file that took long, its next files are taken for large.

        Raises:
            HTTPException: 503, too many files wait.
        """
        now = time.monotonic()
        if not self._is_large(job) and self._slow_until.get(client, 0.0) < now:
            reply = await self._quick.run(job, min(self.limits.quick_timeout_s, self.limits.work_timeout_s))
            if reply.status != 504:
                return reply
            self._slow_until = {name: until for name, until in self._slow_until.items() if until > now}
            self._slow_until[client] = now + _SLOW_S
        return await self._large.run(job, self.limits.work_timeout_s)

    def _is_large(self, job: Job) -> bool:
        size = len(job.content)
        return size >= self.limits.large_bytes or (
            size >= self.limits.large_text_bytes and _is_text(job.content)
        )

    def check_space(self) -> None:
        """Refuse an upload that would have to wait with too many others.

        Raises:
            HTTPException: 503, too many files wait.
        """
        self._quick.check_space()

    @property
    def problem(self) -> str:
        """Reason why no file can be predicted; empty while the workers do their work."""
        return self._quick.problem

    @property
    def waiting(self) -> int:
        """Number of files that wait for a worker or are processed."""
        return self._quick.taken + self._large.taken

    def wait_until_ready(self) -> Method:
        """Return the network or rule, once all workers have loaded it.

        Raises:
            DoorstateError: the predictor cannot be loaded.
        """
        return self._quick.wait_until_ready()

    def close(self) -> None:
        """Drop the waiting files, and end the workers."""
        self._quick.close()
        self._large.close()


def _is_text(content: bytes) -> bool:
    """Return True if a file starts as one of text; binary files have only a short header of text."""
    start = content[:_TEXT_SAMPLE]
    return start.isascii() and not start.translate(None, _TEXT)


class _Lane:
    """Workers that share a queue."""

    def __init__(self, workers: list[Worker], length: int) -> None:
        self._workers = workers
        self._idle: queue.SimpleQueue[Worker] = queue.SimpleQueue()
        for worker in workers:
            self._idle.put(worker)
        self._threads = ThreadPoolExecutor(len(workers), "doorstate-worker")
        self._size = len(workers) + length
        self._lock = threading.Lock()
        self.taken = 0
        self.problem = ""

    async def run(self, job: Job, timeout_s: float) -> Reply:
        self.check_space()
        self._change(1)
        future = self._threads.submit(self._work, job, timeout_s)
        # The place is free when the work is done, which may be after the client got a time-out.
        future.add_done_callback(lambda _: self._change(-1))
        return await asyncio.wrap_future(future)

    def check_space(self) -> None:
        if self.taken >= self._size:
            raise HTTPException(503, "too many files are waiting", {"Retry-After": "1"})

    def wait_until_ready(self) -> Method:
        for worker in self._workers:
            worker.start()
        *_, method = [worker.wait_until_ready() for worker in self._workers]
        return method

    def close(self) -> None:
        for worker in self._workers:
            worker.close()
        self._threads.shutdown(cancel_futures=True)

    def _work(self, job: Job, timeout_s: float) -> Reply:
        worker = self._idle.get()
        try:
            reply = worker.run(job, timeout_s)
            self.problem = reply.fault
            return reply
        finally:
            self._idle.put(worker)

    def _change(self, by: int) -> None:
        with self._lock:
            self.taken += by
