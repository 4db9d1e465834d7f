# SPDX-License-Identifier: Apache-2.0
"""Files appear whole or not at all: write beside the target, then rename. Rows of text as CSV."""

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
    """Give a temporary path beside `target` that replaces it when the block ends without an error.

    Raises:
        OutputError: it cannot be written.
    """
    check_writable(target)
    target.parent.mkdir(parents=True, exist_ok=True)
    # The target's ending stays last: writers such as numpy and matplotlib choose the format by it.
    temporary = target.with_name(f".{os.getpid()}.tmp.{target.name}")
    try:
        yield temporary
        temporary.replace(target)
    except OSError as error:
        foreign = error.filename is not None and str(error.filename) != str(temporary)
        if foreign or isinstance(error, FileNotFoundError):  # of the block itself
            raise
        raise OutputError(f"{target}: cannot be written ({error.strerror or error})") from error
    finally:
        temporary.unlink(missing_ok=True)


def check_writable(target: Path) -> None:
    """Ask before long work, and change nothing, whether a file and the folders above it could be made.

    Raises:
        OutputError: it is a folder, or the nearest thing above it that exists is none or may not be written into.
    """
    above = next(folder for folder in target.absolute().parents if os.path.lexists(folder))
    if target.is_dir():
        reason = "it is a folder"
    elif not above.is_dir():
        reason = f"{above} is no folder"
    elif not os.access(above, os.W_OK):
        reason = f"nothing may be written into {above}"
    else:
        return
    raise OutputError(f"{target}: cannot be written ({reason})")


def is_vacant(folder: Path) -> bool:
    """Whether something new may be made here: nothing is there, or at most what a killed write left behind."""
    return not folder.exists() or (folder.is_dir() and all(".tmp." in path.name for path in folder.iterdir()))


def write_text(target: Path, text: str) -> None:
    """Write `text` as UTF-8 in one step."""
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
    # Before Python 3.13 the writer leaves a lone carriage return unquoted, which reads back as the end of a line.
    returns = any("\r" in value for row in rows for value in (*row, *row.values()))
    writer = csv.DictWriter(
        text,
        names,
        restval="",
        lineterminator="\n",
        quoting=csv.QUOTE_ALL if returns else csv.QUOTE_MINIMAL,
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
        raise DatasetError(f"{path}: cannot be read as CSV ({error})") from error
    for number, row in enumerate(rows, start=2):
        if None in row or None in row.values():
            raise DatasetError(f"{path}: line {number} has another number of columns than the header")
    return rows


def _open_text(path: Path) -> TextIO:
    if path.suffix == ".gz":
        return gzip.open(path, "rt", encoding="utf-8-sig", newline="")
    return path.open(encoding="utf-8-sig", newline="")
