# SPDX-License-Identifier: Apache-2.0
"""Workers that share a queue, in which the clients take turns."""

from __future__ import annotations

import asyncio
import math
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

from doorstate.serving.fair_queue import FairQueue
from doorstate.serving.worker import Done, Job, Method, Worker

_UPLOAD_S = 0.1  # a request that was let in counts so long until its file is here; a slow one must not keep others out
_WEIGHT = 0.1  # of a file in the mean of the last ones


class _File(NamedTuple):
    job: Job
    timeout_s: float
    cpu_s: float
    done: asyncio.Future[Done]


class Lane:
    """Workers with a queue of received files, and a queue of requests whose files are not received yet.

    In both the client whose files took the workers the least time comes first. To be used from one event loop.

    Args:
        workers: processes of this lane.
        length: number of received files that wait; then further requests wait unread.
    """

    def __init__(self, workers: list[Worker], length: int) -> None:
        self._workers = workers
        self._idle = list(workers)
        self._threads = ThreadPoolExecutor(len(workers), "doorstate-worker")
        self._size = len(workers) + length
        self._files: FairQueue[_File] = FairQueue()
        self._unread: FairQueue[asyncio.Future[None]] = FairQueue()
        self._let_in: deque[float] = deque()  # times of requests that were let in, until their files are here
        self._timer: asyncio.TimerHandle | None = None
        self._usual_s = 0.0  # work on a file
        self._is_closed = False
        self._tasks: set[asyncio.Task[None]] = set()
        self.taken = 0

    async def wait_for_space(self, client: str) -> None:
        """Wait until a file may be received."""
        if self._places() > 0 and not self._unread:
            self._let_in.append(asyncio.get_running_loop().time())
            return
        turn: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._unread.push(client, turn)
        self._look_later()
        try:
            await turn
        finally:
            self._unread.remove(client, turn)

    async def run(self, job: Job, client: str, timeout_s: float, cpu_s: float = math.inf) -> Done:
        """Return the reply of a worker; the file leaves the queue if the caller is cancelled."""
        file = _File(job, timeout_s, cpu_s, asyncio.get_running_loop().create_future())
        self._files.push(client, file)
        self.taken += 1
        if self._let_in:
            self._let_in.popleft()
        self._start_work()
        try:
            return await file.done
        finally:
            if self._files.remove(client, file):
                self.taken -= 1

    def wait_until_ready(self) -> Method:
        """Return the network or rule, once all workers have loaded it."""
        for worker in self._workers:
            worker.start()
        *_, method = [worker.wait_until_ready() for worker in self._workers]
        return method

    def close(self) -> None:
        """Drop the waiting files, and end the workers."""
        self._is_closed = True
        for worker in self._workers:
            worker.close()
        self._threads.shutdown(cancel_futures=True)

    def _start_work(self) -> None:
        while self._idle and self._files and not self._is_closed:
            client, file = self._files.pop()
            task = asyncio.create_task(self._work(self._idle.pop(0), client, file))
            self._tasks.add(task)  # the loop keeps only a weak reference
            task.add_done_callback(self._tasks.discard)

    async def _work(self, worker: Worker, client: str, file: _File) -> None:
        loop = asyncio.get_running_loop()
        try:
            done = await loop.run_in_executor(self._threads, worker.run, file.job, file.timeout_s, file.cpu_s)
        except Exception as error:
            if not file.done.done():
                file.done.set_exception(error)
        else:
            self._files.charge(client, done.seconds)
            self._unread.charge(client, max(0.0, done.seconds - self._usual_s))
            self._usual_s += _WEIGHT * (done.seconds - self._usual_s)
            if not file.done.done():
                file.done.set_result(done)
        finally:
            # The place is free when the work is done, which may be after the client got a time-out.
            self._idle.append(worker)
            self.taken -= 1
            self._start_work()
            self._admit()

    def _places(self) -> int:
        """Return the number of requests that may be let in now."""
        now = asyncio.get_running_loop().time()
        while self._let_in and self._let_in[0] < now - _UPLOAD_S:
            self._let_in.popleft()
        return self._size - self.taken - len(self._let_in)

    def _admit(self) -> None:
        """Let requests in, to receive their files."""
        for _ in range(min(self._places(), len(self._unread))):
            client, turn = self._unread.pop()
            self._unread.charge(client, self._usual_s)
            if not turn.done():
                self._let_in.append(asyncio.get_running_loop().time())
                turn.set_result(None)

    def _look_later(self) -> None:
        """Look for places now and then: those that were let in may have sent nothing, so that no work ends."""
        if self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(_UPLOAD_S, self._look)

    def _look(self) -> None:
        self._timer = None
        self._admit()
        if self._unread:
            self._look_later()
