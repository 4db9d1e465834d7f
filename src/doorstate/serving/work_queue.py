# SPDX-License-Identifier: Apache-2.0
"""Files that wait for worker processes; large files, and clients whose files fail, have a worker of low priority."""

from __future__ import annotations

import asyncio

from fastapi import HTTPException

from doorstate.serving.clients import Credit
from doorstate.serving.lane import Lane
from doorstate.serving.limits import Limits
from doorstate.serving.worker import LOW_PRIORITY, Job, LoadPredictor, Method, Reply, Worker

_TEXT = bytes([*range(32, 127), *b"\t\r\n"])
_TEXT_SAMPLE = 4096
_TEXT_SUFFIXES = {".csv", ".txt", ".xyz"}
_LEAST_FAILURE_S = 0.02  # of the process that receives it
_RECEIVE_S = 5e-3 / 2**20  # for each byte
_SUCCESS_S = 0.05


class WorkQueue:
    """Worker processes and the files that wait for them, for one event loop.

    A large file takes long to read. It goes to one more worker, of low priority, so that any number of them slows the
    others by a few percent; so does a small file that turns out to take long or much memory, and each file of a client
    whose files failed (`Credit`). That worker starts with the first one. The clients take turns.

    Args:
        load: loads the predictor, in each worker.
        limits: limits of the service.
    """

    def __init__(self, load: LoadPredictor, limits: Limits) -> None:
        self.limits = limits
        self._credit = Credit(limits.failure_s, limits.failure_share)
        self._quick = Lane([Worker(load, limits) for _ in range(limits.workers)], limits.queue)
        self._large = Lane([Worker(load, limits, LOW_PRIORITY)], max(1, limits.queue // 8))
        self.problem = ""
        """Fault of the service at the last file, whatever the file; empty if there was none."""

    async def wait_for_space(self, client: str, size: int, suffix: str | None) -> None:
        """Wait until a file may be received.

        Args:
            client: name of the client.
            size: bytes of the file that the head of the request announces.
            suffix: format of the file, if that is known.

        Raises:
            HTTPException: 429 too many failures of this client, 503 too many files wait.
        """
        debt_s = self._credit.seconds_in_debt(client)
        is_large = self._is_large(size, suffix in _TEXT_SUFFIXES)
        lane = self._large if debt_s or is_large else self._quick
        try:
            async with asyncio.timeout(self.limits.unread_timeout_s):
                if debt_s and is_large and self.is_busy:
                    # In vain: a refusal at once would be followed by the next request.
                    await asyncio.Event().wait()
                await lane.wait_for_space(client)
        except TimeoutError as error:
            if debt_s:
                reason = "too many files of this address failed"
                raise HTTPException(429, reason, {"Retry-After": str(debt_s)}) from error
            raise HTTPException(503, "too many files are waiting", {"Retry-After": "1"}) from error

    async def run(self, job: Job, client: str) -> Reply:
        """Return the reply of a worker.

        Args:
            job: file to predict.
            client: name of the client.
        """
        reply = await self._run(job, client)
        self.problem = reply.fault
        return reply

    async def _run(self, job: Job, client: str) -> Reply:
        size = len(job.content)
        is_large = self._is_large(size, _is_text(job.content))
        if not is_large and not self._credit.seconds_in_debt(client):
            limits = self.limits
            reply, seconds = await self._quick.run(job, client, limits.work_timeout_s, limits.quick_timeout_s)
            self._settle(client, reply, seconds)
            if reply.status not in (413, 504):
                return reply
        reply, _ = await self._large.run(job, client, self.limits.work_timeout_s)
        if not is_large:
            self._settle(client, reply, 0.0)
        return reply

    def note_failed_upload(self, client: str, size: int) -> None:
        """Take credit from a client whose upload was not completed after a number of bytes."""
        self._credit.change(client, -max(_LEAST_FAILURE_S, size * _RECEIVE_S))

    def _settle(self, client: str, reply: Reply, seconds: float) -> None:
        if not reply.fault:
            failed = reply.status != 200
            self._credit.change(client, -max(_LEAST_FAILURE_S, seconds) if failed else _SUCCESS_S)

    def _is_large(self, size: int, is_text: bool) -> bool:
        return size >= (self.limits.large_text_bytes if is_text else self.limits.large_bytes)

    @property
    def is_busy(self) -> bool:
        """True while small files wait or are processed."""
        return self._quick.taken > 0

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
