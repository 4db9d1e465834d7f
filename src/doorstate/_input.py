# SPDX-License-Identifier: Apache-2.0
"""Files given by a user: regular files only, with a limit on their bytes, checked before anything is read."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from doorstate.errors import CloudReadError, DoorstateError

MAX_SETTINGS_BYTES = 1 << 20  # of an experiment, a card, a description: written by hand or of a few kB
MAX_TABLE_BYTES = 1 << 31  # of a manifest, an index, a table of predictions, also unpacked

_KINDS: tuple[tuple[Callable[[int], bool], str], ...] = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def check_input(
    path: str | Path, max_bytes: int | None = None, error: type[DoorstateError] = CloudReadError
) -> None:
    """Check that a path is a regular file, or a link to one, of at most `max_bytes`; for libraries that open it.

    Args:
        path: file to check; it is not opened.
        max_bytes: largest size, or None for files that are read piece by piece.
        error: class of the error.

    Raises:
        DoorstateError: of class `error`, with the path: missing, a folder, pipe, socket or device, or too large.
    """
    try:
        status = Path(path).stat()
    except (OSError, ValueError) as problem:  # ValueError: a null byte in the name
        raise _unreadable(path, problem, error) from problem
    _check_status(status, path, max_bytes, error)


@contextmanager
def open_input(
    path: str | Path, max_bytes: int | None = None, error: type[DoorstateError] = CloudReadError
) -> Iterator[BinaryIO]:
    """Open a regular file for reading, after `check_input`; OSError while it is read becomes `error` too.

    Raises:
        DoorstateError: of class `error`, with the path.
    """
    check_input(path, max_bytes, error)
    try:
        # Without O_NONBLOCK a pipe that took the place of the file meanwhile would wait for a writer.
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | _NONBLOCK)) as stream:
            _check_status(os.fstat(stream.fileno()), path, max_bytes, error)
            yield stream
    except OSError as problem:
        raise _unreadable(path, problem, error) from problem


def read_input(path: str | Path, max_bytes: int, error: type[DoorstateError] = CloudReadError) -> bytes:
    """Return the content of a regular file of at most `max_bytes`.

    Raises:
        DoorstateError: of class `error`, with the path: missing, no regular file, or too large.
    """
    with open_input(path, max_bytes, error) as stream:
        parts = [stream.read(os.fstat(stream.fileno()).st_size + 1)]
        size = len(parts[0])
        # Files of /proc have size 0, and a file may grow.
        while size <= max_bytes and (more := stream.read(_CHUNK_BYTES)):
            parts.append(more)
            size += len(more)
    if size > max_bytes:
        raise _too_large(path, size, max_bytes, error)
    return b"".join(parts)  # the same object where there is one part


def read_input_text(path: str | Path, max_bytes: int, error: type[DoorstateError] = CloudReadError) -> str:
    """Return the text of a UTF-8 file of at most `max_bytes`, without its byte order mark.

    Raises:
        DoorstateError: of class `error`, with the path: as `read_input`, or no UTF-8.
    """
    try:
        return read_input(path, max_bytes, error).decode("utf-8-sig")
    except UnicodeDecodeError as problem:
        raise error(f"is not text in UTF-8 (byte {problem.start})", path=path) from problem


_CHUNK_BYTES = 1 << 16
_NONBLOCK = getattr(os, "O_NONBLOCK", 0)


def _check_status(
    status: os.stat_result, path: str | Path, max_bytes: int | None, error: type[DoorstateError]
) -> None:
    if not stat.S_ISREG(status.st_mode):
        kind = next((name for is_kind, name in _KINDS if is_kind(status.st_mode)), "no regular file")
        raise error(f"is {kind}, not a file", path=path)
    if max_bytes is not None and status.st_size > max_bytes:
        raise _too_large(path, status.st_size, max_bytes, error)


def _too_large(path: str | Path, size: int, max_bytes: int, error: type[DoorstateError]) -> DoorstateError:
    return error(f"holds {size} bytes", path=path, expected=f"at most {max_bytes}")


def _unreadable(path: str | Path, problem: Exception, error: type[DoorstateError]) -> DoorstateError:
    reason = problem.strerror if isinstance(problem, OSError) else None
    return error(f"cannot be read: {reason or problem}", path=path)
