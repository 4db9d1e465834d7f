# SPDX-License-Identifier: Apache-2.0
"""Limits of one service; requests beyond them are refused."""

from __future__ import annotations

from dataclasses import dataclass, field

from doorstate._jobs import default_workers


@dataclass(frozen=True)
class Limits:
    """Limits of one service.

    Args:
        max_bytes: size of a file.
        timeout_s: time from the head of a request to its response, including the upload.
        queue: number of complete files that wait for a worker.
        workers: number of files that are processed at the same time, each in a process.
        work_timeout_s: time to read and predict one file; a worker that takes longer is killed.
        quick_timeout_s: time after which a file is taken for large, and started again as such.
        large_bytes: files from this size on have one more worker, of low priority, to themselves.
        large_text_bytes: the same for text, which takes longer to read.
        head_timeout_s: time for the head of a request.
        stall_timeout_s: time between two parts of an upload.
        large_uploads: number of large files that are received at the same time; others wait unread.
        bytes_in_flight: bytes of all files that were received and are not answered.
        connections: number of open connections.
        client_connections: number of open connections of one address.
        memory_bytes: memory that a worker may take for one file, above that of the loaded network; None sets no limit.
    """

    max_bytes: int = 64 * 2**20
    timeout_s: float = 30.0
    queue: int = 16
    workers: int = field(default_factory=default_workers)
    work_timeout_s: float = 10.0
    quick_timeout_s: float = 2.0
    large_bytes: int = 4 * 2**20
    large_text_bytes: int = 256 * 2**10
    head_timeout_s: float = 5.0
    stall_timeout_s: float = 3.0
    large_uploads: int = 1
    bytes_in_flight: int = 96 * 2**20
    connections: int = 512
    client_connections: int = 128
    memory_bytes: int | None = 320 * 2**20
