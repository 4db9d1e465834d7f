# SPDX-License-Identifier: Apache-2.0
"""How much a service takes on: files no larger, clients no slower, and no more of them than it can answer."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TypeVar

from fastapi import HTTPException, Request

from doorstate._jobs import default_workers

Answer = TypeVar("Answer")


@dataclass(frozen=True)
class Limits:
    """What one service takes on; anything beyond is refused.

    Args:
        max_bytes: of one file.
        timeout_s: from the head of a request to its answer; sending the file is part of it.
        queue: whole files that wait for a worker.
        workers: files in work at a time, each in a thread.
    """

    max_bytes: int = 64 * 2**20
    timeout_s: float = 30.0
    queue: int = 16
    workers: int = field(default_factory=default_workers)


class Workload:
    """Reads files from requests and has them worked on, within limits; methods are for one event loop."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._pool = ThreadPoolExecutor(limits.workers, "doorstate")
        self._places = threading.Semaphore(limits.workers + limits.queue)
        # Files that are still arriving have no place yet, so that slow clients keep nobody out; their bytes count.
        self._most_bytes = (limits.workers + limits.queue) * limits.max_bytes
        self._bytes = 0

    async def answer(self, request: Request, work: Callable[[bytes], Answer]) -> Answer:
        """Call `work` in a worker thread with the body of a request.

        Raises:
            HTTPException: 413 too large, 503 too much to do, 504 too slow.
            ClientDisconnect: the client is gone.
        """
        if not self._take_place():
            raise _busy()
        self._places.release()  # it is taken for good when the file is there
        file, late = bytearray(), "the file had not arrived"
        try:
            async with asyncio.timeout(self._limits.timeout_s):
                await self._read(request, file)
                late = "there was no answer"
                return await self._work(work, bytes(file))
        except TimeoutError as error:
            raise HTTPException(504, f"{late} after {self._limits.timeout_s:g} s") from error
        finally:
            self._bytes -= len(file)

    def close(self) -> None:
        """Forget the files that wait, and end the workers."""
        self._pool.shutdown(cancel_futures=True)

    async def _read(self, request: Request, file: bytearray) -> None:
        most = self._limits.max_bytes
        too_large = HTTPException(413, f"the file has more than {most / 2**20:g} MB")
        if int(request.headers.get("content-length", 0)) > most:
            raise too_large
        async for chunk in request.stream():
            file += chunk
            self._bytes += len(chunk)
            if len(file) > most:
                raise too_large
            if self._bytes > self._most_bytes:
                raise _busy()

    async def _work(self, work: Callable[[bytes], Answer], file: bytes) -> Answer:
        if not self._take_place():
            raise _busy()
        future = self._pool.submit(work, file)
        # A place is free when its work is over, not when its client was told that it took too long.
        future.add_done_callback(lambda _: self._places.release())
        return await asyncio.wrap_future(future)

    def _take_place(self) -> bool:
        return self._places.acquire(blocking=False)


def _busy() -> HTTPException:
    return HTTPException(503, "too many files are waiting: try again", {"Retry-After": "1"})
