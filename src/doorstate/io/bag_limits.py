# SPDX-License-Identifier: Apache-2.0
"""Limits on bags: rosbags alone would unpack a few kB to gigabytes, or run SQLite without end."""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO

from doorstate._input import open_input, read_input_text
from doorstate._paths import resolve_inside
from doorstate.errors import CloudReadError, DatasetError, summarize_exception
from doorstate.io.plain_yaml import plain_documents
from doorstate.io.size_limits import MAX_FILE_BYTES

_MAX_METADATA_BYTES = 1 << 18  # hundreds of topics and files; rosbags takes ten seconds per MiB
MAX_UNPACKED = MAX_FILE_BYTES  # bytes of a message or of a chunk of messages
# Unpacked size of a bag compressed file by file, in packed sizes; depth images of one wall take a twentieth.
_MAX_RATIO = 50
_MAX_DISK_SHARE = 0.5  # of the free space for temporary files
_STARTS = {".bag": b"#ROSBAG V2.0\n", ".db3": b"SQLite format 3\0", ".mcap": b"\x89MCAP0\r\n"}


def unpack_zstd(packed: bytes) -> bytes:
    """Unpack a Zstandard frame.

    Raises:
        ValueError: it is truncated, or larger than a message may be.
    """
    return _unpack(_zstd().ZstdDecompressor, packed)


def limit_unpacking() -> None:
    """Limit what rosbags unpacks to memory and to the disk, in the whole process."""
    from bz2 import BZ2Decompressor

    from lz4.frame import LZ4FrameDecompressor
    from rosbags.rosbag1 import reader as ros1
    from rosbags.rosbag2 import reader as ros2
    from rosbags.rosbag2 import storage_mcap as mcap

    ros1.decompressors["bz2"] = lambda packed: _unpack(BZ2Decompressor, packed)
    ros1.decompressors["lz4"] = lambda packed: _unpack(LZ4FrameDecompressor, packed)
    mcap.DECOMPRESSORS["lz4"] = lambda packed, _: _unpack(LZ4FrameDecompressor, packed)
    mcap.DECOMPRESSORS["zstd"] = lambda packed, _: unpack_zstd(packed)
    ros2.zstd = SimpleNamespace(open=_UnpackedFile, decompress=unpack_zstd)  # type: ignore[assignment, attr-defined]


def keep_packed(reader: Any) -> None:
    """Make a ROS 2 reader return messages as stored; `unpack_zstd` unpacks them."""
    reader.storage.metadata = reader.storage.metadata._replace(compression_mode=None)


@contextmanager
def limited_sqlite() -> Iterator[None]:
    """Refuse views, which may compute without end, and values larger than a message in databases opened meanwhile."""
    import apsw

    def limit(connection: Any) -> None:
        connection.limit(apsw.SQLITE_LIMIT_LENGTH, MAX_UNPACKED)
        # The last argument names the view or trigger that an access comes from.
        connection.authorizer = lambda *access: apsw.SQLITE_DENY if access[-1] else apsw.SQLITE_OK

    apsw.connection_hooks.append(limit)
    try:
        yield
    finally:
        apsw.connection_hooks.remove(limit)


def check_files(path: Path) -> None:
    """Check that a bag is a regular file, or a folder of files of its own and a metadata.yaml of usual size.

    No recorder writes aliases into metadata.yaml; they can expand to gigabytes.

    Raises:
        CloudReadError: it is not, with its path.
    """
    if not path.is_dir():
        _check_start(path)
        return
    for member in path.iterdir():
        try:
            resolve_inside(path, member.name)
        except DatasetError as error:
            raise CloudReadError("is a link out of the folder of the bag", path=member) from error
        if not member.is_dir():
            _check_start(member)
    metadata = path / "metadata.yaml"
    text = read_input_text(metadata, _MAX_METADATA_BYTES)
    if "&" not in text:  # no alias without an anchor; parsing is slow, and rosbags parses again
        return
    try:
        list(plain_documents(text))
    except Exception as error:  # on damaged text the parser raises exceptions of any type
        raise CloudReadError(f"is damaged ({summarize_exception(error)})", path=metadata) from error


def _check_start(path: Path) -> None:
    """Check the first bytes of a file; rosbags would look for the end of a first line in gigabytes of zeros."""
    start = _STARTS.get(path.suffix, b"")
    with open_input(path) as stream:
        if stream.read(len(start)) != start:
            raise CloudReadError("damaged, or no bag (its first bytes)", path=path)


class _UnpackedFile:
    """Packed file for rosbags to copy to the disk, which is not filled."""

    def __init__(self, packed: BinaryIO, mode: str) -> None:
        self._stream = _zstd().open(packed, mode)
        size = packed.seek(0, 2)
        packed.seek(0)
        free = shutil.disk_usage(tempfile.gettempdir()).free
        self._left = int(min(max(MAX_UNPACKED, _MAX_RATIO * size), _MAX_DISK_SHARE * free))

    def __enter__(self) -> _UnpackedFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()

    def read(self, size: int) -> bytes:
        content: bytes = self._stream.read(size)
        self._left -= len(content)
        if self._left < 0:
            raise ValueError(f"unpacks to more than {_MAX_RATIO} times its size, or half of the free disk")
        return content


def _zstd() -> Any:
    if sys.version_info >= (3, 14):
        from compression import zstd
    else:
        from backports import zstd
    return zstd


def _unpack(decompressor: Callable[[], Any], packed: bytes) -> bytes:
    unpacking = decompressor()
    unpacked: bytes = unpacking.decompress(packed, max_length=MAX_UNPACKED + 1)
    if len(unpacked) > MAX_UNPACKED:
        raise ValueError(f"unpacks to more than {MAX_UNPACKED >> 20} MiB: not one camera frame")
    if not unpacking.eof:
        raise ValueError("the packed data is truncated")
    return unpacked
