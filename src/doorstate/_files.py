# SPDX-License-Identifier: Apache-2.0
"""Atomic writing of files (write beside the target, then rename), and tables of text as CSV.

A file under its final name is complete, even if a process is killed or several processes write it: temporary names are
random, because process numbers repeat between containers and threads share one, and the bytes are on the disk before
the rename.
"""

from __future__ import annotations

import csv
import gzip
import io
import os
import re
import secrets
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from doorstate._input import MAX_TABLE_BYTES, open_input
from doorstate.errors import DatasetError, OutputError

_MAX_LINE = 1 << 24  # of a table: a scene of a manifest takes some thousands
LOCK_PREFIX = ".doorstate"  # of the files that `_locks` keeps in a folder
_NOT_UTF_8 = "backslashreplace"  # names of files may hold such bytes
_SCRATCH = re.compile(rf"\.[0-9a-f]+\.tmp\..+|{re.escape(LOCK_PREFIX)}.*\.(lock|owner)")


@contextmanager
def atomic_path(target: Path, durable: bool = True) -> Iterator[Path]:
    """Yield a temporary path beside `target`, which replaces the target if the block ends without an error.

    Args:
        target: file to write.
        durable: wait until the file and its name are on the disk; without it, a power cut may lose the file.

    Raises:
        OutputError: the target cannot be written.
    """
    check_writable(target)
    target.parent.mkdir(parents=True, exist_ok=True)
    # The suffix stays the same, because numpy and matplotlib choose the format by it.
    temporary = target.with_name(f".{secrets.token_hex(8)}.tmp.{target.name}")
    try:
        yield temporary
        if durable:
            _sync(temporary)
        temporary.replace(target)
        if durable:
            _sync_folder(target.parent)
    except OSError as error:
        is_other_file = error.filename is not None and str(error.filename) != str(temporary)
        if is_other_file or isinstance(error, FileNotFoundError):
            raise
        raise OutputError(f"cannot be written ({error.strerror or error})", path=target) from error
    finally:
        temporary.unlink(missing_ok=True)


def _sync(path: Path, flags: int = os.O_RDWR) -> None:
    descriptor = os.open(path, flags)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _sync_folder(folder: Path) -> None:
    with suppress(OSError):  # Windows opens no folders, and some network file systems do not sync them
        _sync(folder, os.O_RDONLY)


def check_writable(target: Path) -> None:
    """Check, before long work and without changing anything, that a file and its folders could be created.

    Raises:
        OutputError: the target is a folder, or its nearest existing parent is not a folder or not writable.
    """
    parent = next(folder for folder in target.absolute().parents if os.path.lexists(folder))
    if target.is_dir():
        reason = "it is a folder"
    elif not parent.is_dir():
        reason = f"{parent} is not a folder"
    elif not os.access(parent, os.W_OK):
        reason = f"{parent} is not writable"
    else:
        return
    raise OutputError(f"cannot be written ({reason})", path=target)


def is_scratch(path: Path) -> bool:
    """Return True for temporary files of interrupted writes, and files of locks."""
    return _SCRATCH.fullmatch(path.name) is not None


def remove_scratch(targets: Iterable[Path]) -> None:
    """Remove temporary files of killed processes that were writing one of the targets."""
    names: dict[Path, set[str]] = {}
    for target in targets:
        names.setdefault(target.parent, set()).add(target.name)
    for folder in filter(Path.is_dir, names):
        for path in folder.glob(".*.tmp.*"):
            if path.name.partition(".tmp.")[2] in names[folder]:
                path.unlink(missing_ok=True)


def is_vacant(folder: Path) -> bool:
    """Return True if a folder does not exist, or holds nothing but temporary files and locks."""
    return not folder.exists() or (folder.is_dir() and all(map(is_scratch, folder.iterdir())))


def write_text(target: Path, text: str, durable: bool = True) -> None:
    """Write `text` as UTF-8, atomically; `durable` as in `atomic_path`."""
    with atomic_path(target, durable) as temporary:
        temporary.write_text(text, encoding="utf-8", errors=_NOT_UTF_8)


def write_compressed_text(target: Path, text: str) -> None:
    """Write `text` as UTF-8, compressed with gzip; the same text gives the same bytes."""
    with atomic_path(target) as temporary:
        temporary.write_bytes(gzip.compress(text.encode("utf-8", _NOT_UTF_8), mtime=0))


def write_csv(path: Path, rows: Sequence[Mapping[str, str]]) -> None:
    """Write rows under the union of their columns, in order of appearance; compressed if the name ends in `.gz`."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO(newline="")
    # Before Python 3.13 the writer does not quote a lone carriage return, which is then read as the end of a line.
    has_returns = any("\r" in value for row in rows for value in (*row, *row.values()))
    writer = csv.DictWriter(
        text,
        names,
        restval="",
        lineterminator="\n",
        quoting=csv.QUOTE_ALL if has_returns else csv.QUOTE_MINIMAL,
    )
    writer.writeheader()
    writer.writerows(rows)
    write = write_compressed_text if path.suffix == ".gz" else write_text
    write(path, text.getvalue())


def read_csv(path: Path) -> list[dict[str, str]]:
    """Read a CSV with a header line; decompress it if the name ends in `.gz`.

    Raises:
        DatasetError: the file is missing, too large or no text, or a line has more or fewer columns than the header.
    """
    rows: list[dict[str, str]] = []
    before: dict[str, str] = {}
    try:
        for row in csv.DictReader(_table_lines(path), strict=True):
            # Lines of one scene repeat most texts, which would fill half of the memory.
            repeated = {name for name, text in before.items() if row.get(name) == text}
            before = {name: before[name] if name in repeated else text for name, text in row.items()}
            rows.append(before)
    except (OSError, EOFError, zlib.error, UnicodeDecodeError, csv.Error) as error:
        raise DatasetError(f"cannot be read as CSV ({error})", path=path) from error
    for number, row in enumerate(rows, start=2):
        if None in row or None in row.values():
            raise DatasetError(f"line {number} has another number of columns than the header", path=path)
    return rows


def _table_lines(path: Path) -> Iterator[str]:
    """Yield the lines of a table one after another, so that its text is never in memory as a whole.

    Errors are those of `read_table_text`.
    """
    rest = MAX_TABLE_BYTES
    with open_input(path, MAX_TABLE_BYTES, DatasetError) as stream:
        unpacked = gzip.GzipFile(fileobj=stream) if path.suffix == ".gz" else stream
        text = io.TextIOWrapper(unpacked, encoding="utf-8-sig", newline="")
        while line := text.readline(min(rest, _MAX_LINE) + 1):
            rest -= len(line)
            if rest < 0 or len(line) > _MAX_LINE:
                raise _too_large(path)
            yield line


def _too_large(path: Path) -> DatasetError:
    return DatasetError("is too large", path=path, expected=f"at most {MAX_TABLE_BYTES} bytes of text")


def read_table_text(path: Path) -> str:
    """Read a table's text in UTF-8, unpacked if its name ends in `.gz`.

    Raises:
        DatasetError: the file is missing, no regular file, or too large, packed or unpacked.
        OSError, EOFError, zlib.error, UnicodeDecodeError: it is damaged.
    """
    with open_input(path, MAX_TABLE_BYTES, DatasetError) as stream:
        unpacked = gzip.GzipFile(fileobj=stream) if path.suffix == ".gz" else stream
        content = unpacked.read(MAX_TABLE_BYTES + 1)
    if len(content) > MAX_TABLE_BYTES:
        raise _too_large(path)
    return content.decode("utf-8-sig")
