# SPDX-License-Identifier: Apache-2.0
"""Small files that unpack to a large number of points or pixels, all zero."""

from __future__ import annotations

import io
import struct
import zipfile
import zlib

from numpy.lib import format as npy_format

_ROW = 4096


def bomb(suffix: str, count: int) -> bytes:
    """Return a .npz, .png or .pcd file of `count` points."""
    return {".npz": _npz, ".png": _png, ".pcd": _pcd}[suffix](count)


def _npz(count: int) -> bytes:
    stream = io.BytesIO()
    with (
        zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("points.npy", "w", force_zip64=True) as member,
    ):
        header = {"descr": "<f4", "fortran_order": False, "shape": (count, 3)}
        npy_format.write_array_header_1_0(member, header)
        for start in range(0, count, _ROW):
            member.write(bytes(12 * min(_ROW, count - start)))
    return stream.getvalue()


def _png(count: int) -> bytes:
    pack = zlib.compressobj()
    rows = b"".join(pack.compress(bytes(1 + 2 * _ROW)) for _ in range(count // _ROW)) + pack.flush()
    header = struct.pack(">IIBBBBB", _ROW, count // _ROW, 16, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + _chunk(b"IHDR", header) + _chunk(b"IDAT", rows) + _chunk(b"IEND", b"")


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def _pcd(count: int) -> bytes:
    packed = bytes(count * 12 // 80)
    sizes = struct.pack("<II", len(packed), count * 12)
    header = f"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nPOINTS {count}\nDATA binary_compressed\n"
    return f"VERSION 0.7\n{header}".encode() + sizes + packed
