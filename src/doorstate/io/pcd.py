# SPDX-License-Identifier: Apache-2.0
"""Point Cloud Library files (.pcd): ASCII, binary and compressed.

The header is checked against the file size (`pcd_header`), and passed to pypcd4 in a normal form: pypcd4 itself rejects
headers of PCD 0.5 and 0.6 or without COUNT, and trusts any declared size. ASCII rows are read like other tables,
because pypcd4 rejects doubled or trailing blanks. Points stay in the coordinates they are stored in: VIEWPOINT is for
the caller to apply.
"""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pypcd4.pypcd4 import Encoding, MetaData, PointCloud

from doorstate._files import atomic_path
from doorstate._organized import flatten_unless_image
from doorstate.errors import CloudContentError, CloudReadError
from doorstate.io.pcd_header import PcdHeader, read_pcd_header
from doorstate.io.size_limits import check_point_count, check_size
from doorstate.io.text_rows import parse_rows
from doorstate.types import Points

_COMPRESSED_SIZES = struct.Struct("<II")
# LZF's longest back reference turns 3 bytes into 264.
_MAX_EXPANSION = 88
# pypcd4 makes a field for every value. The longest features of a point are SHOT's 352 and its colours' 1344.
_MAX_POINT_VALUES = 4096


def parse_pcd(data: bytes) -> NDArray[Any]:
    """Read the fields x, y, z of every point.

    Returns:
        (N, 3), or (H, W, 3) of an organized file, in file order and units, NaN kept. A file that declares rows and
        columns, but whose points have been shuffled, is (N, 3).

    Raises:
        CloudReadError: the header lacks x, y, z or contradicts itself, or points are missing.
    """
    header = read_pcd_header(data)
    check_point_count(header.points)
    if header.points == 0:
        return np.empty((0, 3), dtype=np.float32)
    points = _parse_points(header, data)
    if min(header.height, header.width) > 1 and header.height * header.width == header.points:
        return flatten_unless_image(points.reshape(header.height, header.width, 3))
    return points


def _parse_points(header: PcdHeader, data: bytes) -> NDArray[Any]:
    places = [next(i for i, field in enumerate(header.fields) if field.name == axis) for axis in "xyz"]
    values = sum(field.values for field in header.fields)
    body = data[header.body :]
    if header.encoding == "ascii":
        columns = [sum(field.values for field in header.fields[:place]) for place in places]
        lines = len(data[: header.body].splitlines())
        return parse_rows(body, columns, header.points, first_line=lines + 1)
    if values > _MAX_POINT_VALUES:
        raise CloudReadError(f"has {values} values per point", expected=f"at most {_MAX_POINT_VALUES}")
    declared = header.points * sum(field.size * field.values for field in header.fields)
    if header.encoding == "binary":
        check_size(declared, len(body), "bytes")
    else:
        check_size(_COMPRESSED_SIZES.size, len(body), "bytes")
        compressed, unpacked = _COMPRESSED_SIZES.unpack_from(body)
        check_size(compressed, len(body) - _COMPRESSED_SIZES.size, "bytes")
        if unpacked != declared or unpacked > _MAX_EXPANSION * compressed:
            raise CloudReadError(f"is damaged: {declared} bytes are declared, {unpacked} are packed")
    metadata = MetaData.model_validate(
        {
            # pypcd4 needs unique names: fields other than x, y, z (padding, repeated names) are named by their place.
            "fields": [
                field.name if place in places else f"field_{place}"
                for place, field in enumerate(header.fields)
            ],
            "size": [field.size for field in header.fields],
            "type": [field.kind for field in header.fields],
            "count": [field.values for field in header.fields],
            "points": header.points,
            "width": header.points,
            "data": header.encoding,
        }
    )
    stream = io.BytesIO(metadata.compose_header().encode() + body)
    return PointCloud.from_fileobj(io.BufferedReader(stream)).numpy(("x", "y", "z"))


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
