# SPDX-License-Identifier: Apache-2.0
"""Uploads in progress: their size, their speed, and the bytes of all of them together."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable
from contextlib import AsyncExitStack

from fastapi import HTTPException, Request
from starlette.requests import ClientDisconnect

from doorstate.serving.limits import Limits

_IDLE_S = 0.5  # an upload without a byte for this time gives way to others


class IncompleteUpload(HTTPException):
    """Upload that stopped.

    Args:
        status: HTTP status.
        detail: reason.
        size: number of bytes that were received.
    """

    def __init__(self, status: int, detail: str, size: int) -> None:
        super().__init__(status, detail)
        self.size = size


class Uploads:
    """Bodies of requests, within a number of bytes for all; to be used from one event loop.

    When the bytes are used up, the upload that has been idle for the longest time ends, and its bytes are free.

    Args:
        limits: limits of the service.
        is_busy: returns True while small files are processed; then large ones are received slowly.
    """

    def __init__(self, limits: Limits, is_busy: Callable[[], bool] = lambda: False) -> None:
        self._limits, self._is_busy = limits, is_busy
        self._open: set[Upload] = set()
        self._large = asyncio.Semaphore(limits.large_uploads)
        self._client_bytes: Counter[str] = Counter()
        self.total_bytes = 0

    async def read(self, request: Request, client: str, declared: int) -> Upload:
        """Return the body of a request, whose bytes count until `release`.

        Args:
            request: request of which only the head was read.
            client: name of the client.
            declared: length in the head, as `declared_bytes` returns it.

        Raises:
            IncompleteUpload: 408 too slow, 400 the client closed the connection.
            HTTPException: 411 large without a length, 413 too large, 503 too many bytes.
        """
        upload = Upload(client, self._limits.stall_timeout_s)
        self._open.add(upload)
        try:
            async with AsyncExitStack() as stack:
                if declared >= self._limits.large_bytes:
                    await self._wait_for_place(stack)
                await self._receive(request, upload, declared)
        except BaseException:
            self.release(upload)
            raise
        finally:
            self._open.remove(upload)
        return upload

    async def _receive(self, request: Request, upload: Upload, declared: int) -> None:
        large = self._limits.large_bytes
        try:
            async with asyncio.timeout(upload.patience_s) as upload.deadline:
                async for chunk in request.stream():
                    self._add(upload, chunk)
                    if declared < large <= len(upload.content):
                        raise HTTPException(411, "a large file needs a Content-Length")
                    if declared >= large and self._is_busy():
                        await asyncio.sleep(len(chunk) / self._limits.large_bytes_per_s)
        except TimeoutError as error:
            problem = f"no part of the file arrived for {upload.patience_s:g} s"
            raise IncompleteUpload(408, problem, len(upload.content)) from error
        except ClientDisconnect as error:  # for the log: the client is gone
            raise IncompleteUpload(400, "the client closed the connection", len(upload.content)) from error

    async def _wait_for_place(self, stack: AsyncExitStack) -> None:
        """Take one of the places of large uploads until the stack is closed; meanwhile nothing of it is received."""
        try:
            async with asyncio.timeout(self._limits.stall_timeout_s):
                await stack.enter_async_context(self._large)
        except TimeoutError as error:
            raise _busy() from error

    def release(self, upload: Upload) -> None:
        """Stop counting the bytes of an upload."""
        self._count(upload, -len(upload.content))
        upload.content = bytearray()

    def _add(self, upload: Upload, chunk: bytes) -> None:
        if len(upload.content) + len(chunk) > self._limits.max_bytes:
            raise _too_large(self._limits.max_bytes)
        while self._is_full(upload, len(chunk)):
            if not self._end_idle(upload):
                raise _busy()
        upload.content += chunk
        self._count(upload, len(chunk))
        upload.progress()

    def _is_full(self, upload: Upload, size: int) -> bool:
        # Half of the bytes are kept for other clients.
        of_client = self._client_bytes[upload.client] + size
        alone = len(self._client_bytes) == 1
        limit = self._limits.bytes_in_flight
        return self.total_bytes + size > limit or (not alone and of_client > max(limit // 2, size))

    def _end_idle(self, newcomer: Upload) -> bool:
        """End the upload that has been idle for the longest time; return False if there is none."""
        now_s = _now_s()
        idle = [
            upload
            for upload in self._open
            if upload is not newcomer and upload.content and now_s - upload.last_s > _IDLE_S
        ]
        if not idle:
            return False
        longest = min(idle, key=lambda upload: upload.last_s)
        longest.end()
        self.release(longest)
        return True

    def _count(self, upload: Upload, size: int) -> None:
        self.total_bytes += size
        self._client_bytes[upload.client] += size
        if self._client_bytes[upload.client] <= 0:
            del self._client_bytes[upload.client]


class Upload:
    """Content of a request, and the time of its last part.

    Args:
        client: address of the client.
        patience_s: longest time between two parts.
    """

    def __init__(self, client: str, patience_s: float) -> None:
        self.client = client
        self.patience_s = patience_s
        self.content: bytes | bytearray = bytearray()
        self.deadline: asyncio.Timeout | None = None
        self.last_s = _now_s()

    def progress(self) -> None:
        """Start the time until the next part."""
        self.last_s = _now_s()
        if self.deadline is not None:
            self.deadline.reschedule(self.last_s + self.patience_s)

    def end(self) -> None:
        """Let the upload time out now."""
        if self.deadline is not None and not self.deadline.expired():
            self.deadline.reschedule(_now_s())


def _now_s() -> float:
    return asyncio.get_running_loop().time()


def declared_bytes(request: Request, limit: int) -> int:
    """Return the number of bytes that the head of a request announces; 0 if it does not.

    Raises:
        HTTPException: 400 no number, 413 more than the limit.
    """
    try:
        declared = int(request.headers.get("content-length", 0))
    except ValueError as error:
        raise HTTPException(400, "Content-Length is not a number") from error
    if declared > limit:
        raise _too_large(limit)
    return declared


def _busy() -> HTTPException:
    return HTTPException(503, "too many files are being received", {"Retry-After": "1"})


def _too_large(limit: int) -> HTTPException:
    return HTTPException(413, f"the file is larger than {limit / 2**20:g} MiB")
