# SPDX-License-Identifier: Apache-2.0
"""Bounded work of a service: size of files, speed of clients, and number of files that wait."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TypeVar

from fastapi import HTTPException, Request

from doorstate._jobs import default_workers

Result = TypeVar("Result")


@dataclass(frozen=True)
class Limits:
    """Limits of one service; requests beyond them are refused.

    Args:
        max_bytes: size of a file.
        timeout_s: time from the head of a request to its response, including the upload.
        queue: number of complete files that wait for a worker.
        workers: number of files that are processed at the same time, each in a thread.
    """

    max_bytes: int = 64 * 2**20
    timeout_s: float = 30.0
    queue: int = 16
    workers: int = field(default_factory=default_workers)


class WorkQueue:
    """Reads files from requests, and processes them in worker threads; to be used from one event loop.

    Args:
        limits: limits of the service.
    """

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._pool = ThreadPoolExecutor(limits.workers, "doorstate")
        self._slots = threading.Semaphore(limits.workers + limits.queue)
        # An upload takes no slot, so that slow clients do not block others; its bytes are counted instead.
        self._max_total_bytes = (limits.workers + limits.queue) * limits.max_bytes
        self._total_bytes = 0

    async def run(self, request: Request, work: Callable[[bytes], Result]) -> Result:
        """Call `work` in a worker thread with the body of a request, and return its result.

        Raises:
            HTTPException: 400 length that is no number, 413 too large, 503 too many files, 504 too slow.
            ClientDisconnect: the client closed the connection.
        """
        if not self._take_slot():
            raise _busy()
        self._slots.release()  # taken again once the upload is complete
        file, problem = bytearray(), "the upload was not complete"
        try:
            async with asyncio.timeout(self._limits.timeout_s):
                await self._read(request, file)
                problem = "there was no result"
                return await self._work(work, bytes(file))
        except TimeoutError as error:
            raise HTTPException(504, f"{problem} after {self._limits.timeout_s:g} s") from error
        finally:
            self._total_bytes -= len(file)

    def close(self) -> None:
        """Drop the waiting files, and stop the workers."""
        self._pool.shutdown(cancel_futures=True)

    async def _read(self, request: Request, file: bytearray) -> None:
        limit = self._limits.max_bytes
        too_large = HTTPException(413, f"the file is larger than {limit / 2**20:g} MiB")
        try:
            declared = int(request.headers.get("content-length", 0))
        except ValueError as error:
            raise HTTPException(400, "Content-Length is not a number") from error
        if declared > limit:
            raise too_large
        async for chunk in request.stream():
            file += chunk
            self._total_bytes += len(chunk)
            if len(file) > limit:
                raise too_large
            if self._total_bytes > self._max_total_bytes:
                raise _busy()

    async def _work(self, work: Callable[[bytes], Result], file: bytes) -> Result:
        if not self._take_slot():
            raise _busy()
        future = self._pool.submit(work, file)
        # The slot is free when the work is done, which may be after the client got a time-out.
        future.add_done_callback(lambda _: self._slots.release())
        return await asyncio.wrap_future(future)

    def _take_slot(self) -> bool:
        return self._slots.acquire(blocking=False)


def _busy() -> HTTPException:
    return HTTPException(503, "too many files are waiting", {"Retry-After": "1"})
