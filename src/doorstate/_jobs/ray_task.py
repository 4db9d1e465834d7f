# SPDX-License-Identifier: Apache-2.0
"""Pieces of one task of Ray, in its worker process."""

from __future__ import annotations

import os
import signal
import socket
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from doorstate import __version__
from doorstate._jobs.pieces import Work
from doorstate.errors import FolderInUseError, RunError

_WAIT_FOR_LOCK_S = 120.0  # a file server drops the locks of a lost machine within this time


class PieceBatch(NamedTuple):
    """Pieces of a task, and what its process needs to know."""

    work: Work
    pieces: Sequence[tuple[Any, Path]]
    folder: Path  # in which the program was started
    version: str  # of this package there
    hides_gpus: bool


def run_batch(batch: PieceBatch) -> tuple[float, str]:
    """Run the pieces whose files are missing; return the seconds it took and the name of the machine.

    Raises:
        RunError: the machine has another version of this package, or does not have the folder.
    """
    host = socket.gethostname()
    if batch.version != __version__:
        raise RunError(f"{host} has doorstate {__version__}", expected=batch.version)
    try:
        os.chdir(batch.folder)
    except OSError as error:
        raise RunError(
            f"cannot be used on {host} ({error.strerror})",
            path=batch.folder,
            hint="use a folder that all machines share, under the same path",
        ) from error
    # Ray cancels what waits for a place by an interrupt, which must not end what runs already.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if batch.hides_gpus:
        os.environ["CUDA_VISIBLE_DEVICES"] = ""
    started = time.perf_counter()
    for piece, path in batch.pieces:
        if not path.exists():
            _run_when_free(batch.work, piece, path)
    return time.perf_counter() - started, host


def _run_when_free(work: Work, piece: Any, path: Path) -> None:
    """Run a piece, whose folder may still be locked by a process that was lost."""
    waited_until = time.monotonic() + _WAIT_FOR_LOCK_S
    while True:
        try:
            work(piece, path)
            return
        except FolderInUseError:
            if time.monotonic() > waited_until:
                raise
