# SPDX-License-Identifier: Apache-2.0
"""Point Cloud Library files (.pcd): ASCII, binary and compressed.

The header is parsed and checked against the file size here, and passed to pypcd4 in a normal form: pypcd4 itself
rejects headers of PCD 0.5 and 0.6 or without COUNT, and trusts any declared size. ASCII rows are read like other
tables, because pypcd4 rejects doubled or trailing blanks. VIEWPOINT is not applied: points stay in the coordinates
they are stored in.
"""

from __future__ import annotations

import io
import math
import re
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pypcd4.pypcd4 import Encoding, MetaData, PointCloud

from doorstate._files import atomic_path
from doorstate.errors import CloudContentError, CloudReadError
from doorstate.io.size_limits import check_point_count, check_size
from doorstate.io.text import parse_rows
from doorstate.types import Points

_DATA_LINE = re.compile(rb"^DATA[ \t]+(ascii|binary|binary_compressed)[ \t]*(?:\r?\n|\Z)", re.MULTILINE)
_COMPRESSED_SIZES = struct.Struct("<II")
# LZF's longest back reference turns 3 bytes into 264.
_MAX_EXPANSION = 88
# pypcd4 makes a field for every value. The longest features of a point are SHOT's 352 and its colours' 1344.
_MAX_POINT_VALUES = 4096


def parse_pcd(data: bytes) -> NDArray[Any]:
    """Read the fields x, y, z of every point.

    Returns:
        (N, 3), or (H, W, 3) of an organized file, in file order and units, NaN kept.

    Raises:
        CloudReadError: the header lacks x, y, z or contradicts itself, or points are missing.
    """
    header_end = _DATA_LINE.search(data)
    if header_end is None:
        raise CloudReadError(
            "is not a PCD file", expected="a header with DATA ascii, binary or binary_compressed"
        )
    encoding = Encoding(header_end[1].decode())
    metadata, shape = _read_header(data[: header_end.start()].decode("ascii", errors="replace"), encoding)
    return _parse_rows(metadata, data[header_end.end() :]).reshape(shape)


def _parse_rows(metadata: MetaData, body: bytes) -> NDArray[Any]:
    encoding = metadata.data
    check_point_count(metadata.points)
    if metadata.points == 0:
        return np.empty((0, 3), dtype=np.float32)
    if encoding is Encoding.ASCII:
        columns = [sum(metadata.count[: metadata.fields.index(axis)]) for axis in "xyz"]
        return parse_rows(body, columns, metadata.points)
    if sum(metadata.count) > _MAX_POINT_VALUES:
        raise CloudReadError(
            f"has {sum(metadata.count)} values per point", expected=f"at most {_MAX_POINT_VALUES}"
        )
    point_bytes = sum(size * count for size, count in zip(metadata.size, metadata.count, strict=True))
    declared = metadata.points * point_bytes
    if encoding is Encoding.BINARY:
        check_size(declared, len(body), "bytes")
    else:
        compressed, unpacked = _COMPRESSED_SIZES.unpack_from(body)
        check_size(compressed, len(body) - _COMPRESSED_SIZES.size, "bytes")
        if unpacked != declared or unpacked > _MAX_EXPANSION * compressed:
            raise CloudReadError(f"is damaged: {declared} bytes are declared, {unpacked} are packed")
    stream = io.BytesIO(metadata.compose_header().encode() + body)
    cloud = PointCloud.from_fileobj(io.BufferedReader(stream))
    return cloud.numpy(("x", "y", "z"))


def write_pcd(path: Path, points: Points) -> None:
    """Write points as compressed PCD, NaN kept, in one step.

    Args:
        path: file to write; its folder is made.
        points: (N, 3), or (H, W, 3) for an organized cloud of WIDTH W and HEIGHT H; float32 metres.

    Raises:
        CloudContentError: the array has another shape.
    """
    if points.ndim not in (2, 3) or points.shape[-1] != 3:
        raise CloudContentError(f"points of shape {points.shape}", path=path, expected="(N, 3) or (H, W, 3)")
    cloud = PointCloud.from_xyz_points(points.reshape(-1, 3))  # (H * W, 3)
    cloud.metadata.height, cloud.metadata.width = points.shape[:2] if points.ndim == 3 else (1, len(points))
    with atomic_path(path) as temporary:
        cloud.save(temporary, encoding=Encoding.BINARY_COMPRESSED)


def _read_header(text: str, encoding: Encoding) -> tuple[MetaData, tuple[int, ...]]:
    """Return the header for pypcd4, and the shape of the points."""
    entries = {words[0]: words[1:] for line in text.splitlines() if (words := line.split("#")[0].split())}
    fields = entries.get("FIELDS", [])
    if not {"x", "y", "z"} <= set(fields):
        raise CloudReadError(f"has the fields {' '.join(fields) or 'none'}", expected="x, y and z")
    sizes, types = entries.get("SIZE", []), entries.get("TYPE", [])
    counts = entries.get("COUNT", ["1"] * len(fields))
    if not len(fields) == len(sizes) == len(types) == len(counts):
        raise CloudReadError("FIELDS, SIZE, TYPE and COUNT of the header differ in length")
    extent = entries.get("POINTS") or entries.get("WIDTH", []) + entries.get("HEIGHT", ["1"])
    points = math.prod(int(number) for number in extent)
    # pypcd4 needs unique names: fields other than x, y, z (padding, repeated names) are named by their place.
    firsts = {fields.index(axis) for axis in "xyz"}
    height, width = (int(entries.get(name, ["1"])[0]) for name in ("HEIGHT", "WIDTH"))
    shape = (height, width, 3) if min(height, width) > 1 and height * width == points else (points, 3)
    metadata = MetaData.model_validate(
        {
            "fields": [name if place in firsts else f"field_{place}" for place, name in enumerate(fields)],
            "size": sizes,
            "type": types,
            "count": counts,
            "points": points,
            "width": points,
            "data": encoding,
        }
    )
    return metadata, shape
