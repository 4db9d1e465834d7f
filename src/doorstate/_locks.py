# SPDX-License-Identifier: Apache-2.0
"""One owner per output folder: a lock that ends with its process, and a record of who holds it.

The kernel holds the lock (`flock`), not a file with a process number: it works between containers that share a folder,
and a killed process leaves no lock behind. On NFS it works between machines too, where the server runs a lock manager.
"""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path

from filelock import FileLock, Timeout

from doorstate._documents import read_json
from doorstate._files import LOCK_PREFIX, check_writable, is_scratch, write_text
from doorstate.errors import DoorstateError, FolderInUseError

_WAIT_S = 2.0  # workers of a killed process end within this time
_MAX_RECORD_BYTES = 10_000
_POLL_S = 0.05
_STALE_S = 60.0  # age from which a temporary file is abandoned


@contextmanager
def owned_folder(folder: Path, part: str = "") -> Iterator[None]:
    """Own a folder within the block, made if absent; blocks may be nested in one thread.

    A folder has one owner, or one owner for each of several parts that write different files. A folder that cannot be
    written needs no owner.

    Args:
        folder: folder that the block writes.
        part: name of the part of the work, for processes that share a folder.

    Raises:
        FolderInUseError: another process or thread owns the folder, or this part of it.
        OutputError: the folder cannot be made.
    """
    if folder.exists() and not (folder.is_dir() and os.access(folder, os.W_OK)):
        yield
        return
    check_writable(folder / LOCK_PREFIX)
    is_new = not folder.exists()
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with ExitStack() as part_lock:
            with _lock(folder, ""):
                if not part:
                    _check_parts(folder)
                    _remove_scratch(folder)
                    yield
                    return
                part_lock.enter_context(_lock(folder, f"-{part}"))
            yield
    finally:
        if is_new:
            with suppress(OSError):  # not empty
                folder.rmdir()


@contextmanager
def _lock(folder: Path, suffix: str) -> Iterator[None]:
    path = folder.resolve() / f"{LOCK_PREFIX}{suffix}.lock"
    # One object per file and thread, so that a thread can own a folder that it owns.
    lock = FileLock(path, is_singleton=True)
    owner = path.with_suffix(".owner")
    is_outermost = not lock.is_locked
    try:
        lock.acquire(timeout=_WAIT_S, poll_interval=_POLL_S)
        if is_outermost:
            write_text(owner, _record(), durable=False)
        yield
    except Timeout as error:
        raise _in_use(folder, owner) from error
    except BaseException:
        if not lock.is_locked:  # an `acquire` that an interrupt ended leaves its file
            with suppress(Timeout, OSError):
                lock.acquire(timeout=0)
        raise
    finally:
        if lock.is_locked:
            if is_outermost:
                # Removed while held: a process that has opened the file meanwhile finds it unlinked, and opens another.
                owner.unlink(missing_ok=True)
                path.unlink(missing_ok=True)
            lock.release()


def _check_parts(folder: Path) -> None:
    """Raise FolderInUseError if a process owns a part of the folder; the locks of killed ones are removed."""
    for path in sorted(folder.glob(f"{LOCK_PREFIX}-*.lock")):
        with _lock(folder, path.stem.removeprefix(LOCK_PREFIX)):
            pass


def _remove_scratch(folder: Path) -> None:
    """Remove temporary files of killed processes."""
    for path in folder.iterdir():
        if is_scratch(path) and not path.name.startswith(LOCK_PREFIX):
            with suppress(OSError):
                if time.time() - path.stat().st_mtime > _STALE_S:
                    path.unlink()


def _record() -> str:
    started = datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    return json.dumps({"process": os.getpid(), "host": socket.gethostname(), "started": started}) + "\n"


def _in_use(folder: Path, owner: Path) -> FolderInUseError:
    try:
        record = read_json(owner, max_bytes=_MAX_RECORD_BYTES)
        who = f"process {int(record['process'])} on {record['host']} since {record['started']}"
    except (DoorstateError, ValueError, KeyError, TypeError, OverflowError):
        who = "another process"  # which has not written its record yet
    return FolderInUseError(
        f"is in use by {who}", path=folder, hint="wait for it or end it, or choose another folder"
    )
