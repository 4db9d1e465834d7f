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
        queue: number of complete files that wait for a worker; then further requests wait unread.
        unread_timeout_s: time that a request waits unread.
        workers: number of files that are processed at the same time, each in a process.
        work_timeout_s: time to read and predict one file; a worker that takes longer is killed.
        quick_timeout_s: processor time after which a file is taken for large, and started again as such.
        large_bytes: files from this size on have one more worker, of low priority, to themselves.
        large_text_bytes: the same for text, which takes longer to read.
        head_timeout_s: time for the head of a request.
        stall_timeout_s: time between two parts of an upload.
        large_uploads: number of large files that are received at the same time; others wait unread.
        large_bytes_per_s: speed at which large files are received while small ones are processed.
        bytes_in_flight: bytes of all files that were received and are not answered.
        connections: number of open connections.
        client_connections: number of open connections of one address.
        failure_s: seconds of work that one client may lose for the service by files that fail, before its files have to
            go to the worker of low priority; files that are predicted give credit back.
        failure_share: seconds of credit that a client gets back for each second of time.
        memory_bytes: memory that a worker may take for one file, above that of the loaded network; None sets no limit.
    """

    max_bytes: int = 64 * 2**20
    timeout_s: float = 30.0
    queue: int = 16
    unread_timeout_s: float = 3.0
    workers: int = field(default_factory=default_workers)
    work_timeout_s: float = 10.0
    quick_timeout_s: float = 2.0
    large_bytes: int = 4 * 2**20
    large_text_bytes: int = 256 * 2**10
    head_timeout_s: float = 5.0
    stall_timeout_s: float = 3.0
    large_uploads: int = 1
    large_bytes_per_s: float = 16 * 2**20
    bytes_in_flight: int = 96 * 2**20
    connections: int = 512
    client_connections: int = 128
    failure_s: float = 0.2
    failure_share: float = 0.002
    memory_bytes: int | None = 320 * 2**20
