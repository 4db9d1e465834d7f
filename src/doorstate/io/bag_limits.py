# SPDX-License-Identifier: Apache-2.0
"""What a bag may ask of the machine: rosbags itself lets a few kB unpack to gigabytes, or keep SQLite busy for ever."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from doorstate.io.plain_yaml import plain_documents
from doorstate.io.size_limits import MAX_POINTS

MAX_UNPACKED = 32 * MAX_POINTS  # bytes of a message, or of a chunk, which is one message at least


def unpack_zstd(packed: bytes) -> bytes:
    """What a Zstandard frame holds.

    Raises:
        ValueError: more than any message does, or it is truncated.
    """
    if sys.version_info >= (3, 14):
        from compression import zstd
    else:
        from backports import zstd
    return _unpack(zstd.ZstdDecompressor, packed)


def limit_unpacking() -> None:
    """Have rosbags unpack chunks to `MAX_UNPACKED` bytes and no further, in the whole process."""
    from bz2 import BZ2Decompressor

    from lz4.frame import LZ4FrameDecompressor
    from rosbags.rosbag1 import reader as ros1
    from rosbags.rosbag2 import storage_mcap as mcap

    ros1.decompressors["bz2"] = lambda packed: _unpack(BZ2Decompressor, packed)
    ros1.decompressors["lz4"] = lambda packed: _unpack(LZ4FrameDecompressor, packed)
    mcap.DECOMPRESSORS["lz4"] = lambda packed, _: _unpack(LZ4FrameDecompressor, packed)
    mcap.DECOMPRESSORS["zstd"] = lambda packed, _: unpack_zstd(packed)


def keep_packed(reader: Any) -> None:
    """Have a reader of ROS 2 hand over single messages as they are stored: `unpack_zstd` unpacks them."""
    reader.storage.metadata = reader.storage.metadata._replace(compression_mode=None)


@contextmanager
def limited_sqlite() -> Iterator[None]:
    """While databases are opened: no views, which may compute without end, and no value larger than a message."""
    import apsw

    def limit(connection: Any) -> None:
        connection.limit(apsw.SQLITE_LIMIT_LENGTH, MAX_UNPACKED)
        connection.authorizer = lambda *asked: apsw.SQLITE_DENY if asked[-1] else apsw.SQLITE_OK

    apsw.connection_hooks.append(limit)
    try:
        yield
    finally:
        apsw.connection_hooks.remove(limit)


def check_metadata(folder: Path) -> None:
    """Raise YAMLError if metadata.yaml refers to itself: nothing that records does so."""
    text = (folder / "metadata.yaml").read_text(encoding="utf-8")
    if "&" in text:  # without an anchor there is no alias, and rosbags parses too
        list(plain_documents(text))


def _unpack(new: Callable[[], Any], packed: bytes) -> bytes:
    unpacking = new()
    unpacked: bytes = unpacking.decompress(packed, max_length=MAX_UNPACKED + 1)
    if len(unpacked) > MAX_UNPACKED:
        raise ValueError(f"unpacks to more than {MAX_UNPACKED >> 20} MiB: not one camera frame")
    if not unpacking.eof:
        raise ValueError("what is packed does not end")
    return unpacked
