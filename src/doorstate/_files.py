# SPDX-License-Identifier: Apache-2.0
"""Atomic writing of files (write beside the target, then rename), and tables of text as CSV."""

from __future__ import annotations

import csv
import gzip
import io
import os
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from doorstate.errors import DatasetError, OutputError


@contextmanager
def atomic_path(target: Path) -> Iterator[Path]:
    """Yield a temporary path beside `target`, which replaces the target if the block ends without an error.

    Raises:
        OutputError: the target cannot be written.
    """
    check_writable(target)
    target.parent.mkdir(parents=True, exist_ok=True)
    # The suffix stays the same, because numpy and matplotlib choose the format by it.
    temporary = target.with_name(f".{os.getpid()}.tmp.{target.name}")
    try:
        yield temporary
        temporary.replace(target)
    except OSError as error:
        is_other_file = error.filename is not None and str(error.filename) != str(temporary)
        if is_other_file or isinstance(error, FileNotFoundError):
            raise
        raise OutputError(f"cannot be written ({error.strerror or error})", path=target) from error
    finally:
        temporary.unlink(missing_ok=True)


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


def is_vacant(folder: Path) -> bool:
    """Return True if a folder does not exist, or holds nothing but temporary files of interrupted writes."""
    return not folder.exists() or (folder.is_dir() and all(".tmp." in path.name for path in folder.iterdir()))


def write_text(target: Path, text: str) -> None:
    """Write `text` as UTF-8, atomically."""
    with atomic_path(target) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_compressed_text(target: Path, text: str) -> None:
    """Write `text` as UTF-8, compressed with gzip; the same text gives the same bytes."""
    with atomic_path(target) as temporary:
        temporary.write_bytes(gzip.compress(text.encode("utf-8"), mtime=0))


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
        DatasetError: the file is missing, is not text, or a line has another number of columns than the header.
    """
    try:
        with _open_text(path) as stream:
            reader = csv.DictReader(stream, strict=True)
            rows = list(reader)
    except (OSError, EOFError, zlib.error, UnicodeDecodeError, csv.Error) as error:
        raise DatasetError(f"cannot be read as CSV ({error})", path=path) from error
    for number, row in enumerate(rows, start=2):
        if None in row or None in row.values():
            raise DatasetError(f"line {number} has another number of columns than the header", path=path)
    return rows


def _open_text(path: Path) -> TextIO:
    if path.suffix == ".gz":
        return gzip.open(path, "rt", encoding="utf-8-sig", newline="")
    return path.open(encoding="utf-8-sig", newline="")
