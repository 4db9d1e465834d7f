# SPDX-License-Identifier: Apache-2.0
"""Headers of Point Cloud Library files (.pcd), of every version, with the defaults that PCL's own reader has.

Source: pcl/io/src/pcd_io.cpp, readHeader: COLUMNS is FIELDS; without SIZE, TYPE and COUNT every field is one float32;
fields with COUNT 0 are removed.
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from doorstate.errors import CloudReadError

Pose = tuple[float, float, float, float, float, float, float]
IDENTITY: Pose = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)

_MAX_BYTES = 1 << 20  # of a header
_MAX_DIGITS = 18
_DATA_LINE = re.compile(rb"(?:\A|[\r\n])DATA[ \t]+(ascii|binary|binary_compressed)[ \t]*(\r\n|\n|\r|\Z)")
_TYPES = {"F": (4, 8), "U": (1, 2, 4, 8), "I": (1, 2, 4, 8)}


class PcdField(NamedTuple):
    """Field of every point: `values` of `size` bytes; `kind` is F, U or I."""

    name: str
    size: int
    kind: str
    values: int


class PcdHeader(NamedTuple):
    """Header of a PCD file."""

    fields: tuple[PcdField, ...]
    points: int
    width: int
    height: int
    viewpoint: Pose  # x, y, z and quaternion w, x, y, z of the sensor, in the frame of the points
    encoding: str  # ascii, binary or binary_compressed
    body: int  # place of the first byte after the header


def read_pcd_header(data: bytes) -> PcdHeader:
    """Read the header of a PCD file.

    Raises:
        CloudReadError: no PCD file, or the header lacks x, y, z or contradicts itself.
    """
    end = _DATA_LINE.search(data, 0, _MAX_BYTES)
    if end is None:
        raise CloudReadError(
            "is not a PCD file", expected="a header with DATA ascii, binary or binary_compressed"
        )
    text = data[: end.start()].decode("ascii", errors="replace")
    # In a binary file whose lines end with \r alone, a following \n is the first byte of the points.
    body = end.end() - (end[2] == b"\r\n" and "\r" in text and "\n" not in text)
    entries = {words[0]: words[1:] for line in text.splitlines() if (words := line.split("#")[0].split())}
    width, height = (_whole_numbers(entries, name, ["1"])[0] for name in ("WIDTH", "HEIGHT"))
    points = _whole_numbers(entries, "POINTS", [])
    if not points and "WIDTH" not in entries:
        raise CloudReadError("has neither POINTS nor WIDTH", expected="the number of points")
    return PcdHeader(
        _fields(entries),
        points[0] if points else width * height,
        width,
        height,
        _viewpoint(entries.get("VIEWPOINT", [])),
        end[1].decode(),
        body,
    )


def _fields(entries: dict[str, list[str]]) -> tuple[PcdField, ...]:
    names = entries.get("FIELDS") or entries.get("COLUMNS", [])
    if not {"x", "y", "z"} <= set(names):
        raise CloudReadError(f"has the fields {' '.join(names) or 'none'}", expected="x, y and z")
    sizes = _whole_numbers(entries, "SIZE", ["4"] * len(names))
    kinds = entries.get("TYPE", ["F"] * len(names))
    counts = _whole_numbers(entries, "COUNT", ["1"] * len(names))
    if not len(names) == len(sizes) == len(kinds) == len(counts):
        raise CloudReadError("FIELDS, SIZE, TYPE and COUNT of the header differ in length")
    fields = [PcdField(*field) for field in zip(names, sizes, kinds, counts, strict=True)]
    for field in fields:
        if field.size not in _TYPES.get(field.kind, ()):
            raise CloudReadError(
                f"has values of type {field.kind} with {field.size} bytes",
                field=field.name,
                expected="F 4, F 8, or U or I with 1, 2, 4 or 8",
            )
    for axis in "xyz":
        first = next(field for field in fields if field.name == axis)
        if first.values != 1:
            raise CloudReadError(f"has {first.values} values a point", field=axis, expected="one")
    return tuple(field for field in fields if field.values > 0)


def _whole_numbers(entries: dict[str, list[str]], name: str, default: list[str]) -> list[int]:
    words = entries.get(name) or default
    for word in words:
        if not (word.isascii() and word.isdecimal() and len(word) <= _MAX_DIGITS):
            raise CloudReadError(f"is {word[:40]!r} in the header", field=name, expected="whole numbers")
    return [int(word) for word in words]


def _viewpoint(words: list[str]) -> Pose:
    if not words:
        return IDENTITY
    try:
        x, y, z, qw, qx, qy, qz = (float(word) for word in words)
    except ValueError as error:
        raise CloudReadError(
            "is damaged", field="VIEWPOINT", expected="seven numbers: x y z and a quaternion w x y z"
        ) from error
    if not all(map(math.isfinite, (x, y, z, qw, qx, qy, qz))):
        raise CloudReadError("is not finite", field="VIEWPOINT", expected="seven numbers")
    return x, y, z, qw, qx, qy, qz
