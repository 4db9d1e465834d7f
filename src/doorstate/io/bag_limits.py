# SPDX-License-Identifier: Apache-2.0
"""Limits on bags: rosbags alone would unpack a few kB to gigabytes, or run SQLite without end."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from doorstate._input import check_input, read_input_text
from doorstate.errors import CloudReadError, summarize_exception
from doorstate.io.formats import BAG_SUFFIXES
from doorstate.io.plain_yaml import plain_documents
from doorstate.io.size_limits import MAX_FILE_BYTES

_MAX_METADATA_BYTES = 1 << 18  # hundreds of topics and files; rosbags takes ten seconds per MiB
MAX_UNPACKED = MAX_FILE_BYTES  # bytes of a message or of a chunk of messages


def unpack_zstd(packed: bytes) -> bytes:
    """Unpack a Zstandard frame.

    Raises:
        ValueError: it is truncated, or larger than a message may be.
    """
    if sys.version_info >= (3, 14):
        from compression import zstd
    else:
        from backports import zstd
    return _unpack(zstd.ZstdDecompressor, packed)


def limit_unpacking() -> None:
    """Limit the chunks that rosbags unpacks to `MAX_UNPACKED` bytes, in the whole process."""
    from bz2 import BZ2Decompressor

    from lz4.frame import LZ4FrameDecompressor
    from rosbags.rosbag1 import reader as ros1
    from rosbags.rosbag2 import storage_mcap as mcap

    ros1.decompressors["bz2"] = lambda packed: _unpack(BZ2Decompressor, packed)
    ros1.decompressors["lz4"] = lambda packed: _unpack(LZ4FrameDecompressor, packed)
    mcap.DECOMPRESSORS["lz4"] = lambda packed, _: _unpack(LZ4FrameDecompressor, packed)
    mcap.DECOMPRESSORS["zstd"] = lambda packed, _: unpack_zstd(packed)


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
    """Check that a bag is a regular file, or a folder of regular files and a metadata.yaml of usual size.

    No recorder writes aliases into metadata.yaml; they can expand to gigabytes.

    Raises:
        CloudReadError: it is not, with its path.
    """
    if not path.is_dir():
        check_input(path)
        return
    for member in path.iterdir():
        if member.suffix in (*BAG_SUFFIXES, ".zstd"):
            check_input(member)
    metadata = path / "metadata.yaml"
    text = read_input_text(metadata, _MAX_METADATA_BYTES)
    if "&" not in text:  # no alias without an anchor; parsing is slow, and rosbags parses again
        return
    try:
        list(plain_documents(text))
    except Exception as error:  # on damaged text the parser raises exceptions of any type
        raise CloudReadError(f"is damaged ({summarize_exception(error)})", path=metadata) from error


def _unpack(decompressor: Callable[[], Any], packed: bytes) -> bytes:
    unpacking = decompressor()
    unpacked: bytes = unpacking.decompress(packed, max_length=MAX_UNPACKED + 1)
    if len(unpacked) > MAX_UNPACKED:
        raise ValueError(f"unpacks to more than {MAX_UNPACKED >> 20} MiB: not one camera frame")
    if not unpacking.eof:
        raise ValueError("the packed data is truncated")
    return unpacked
