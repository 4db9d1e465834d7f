# SPDX-License-Identifier: Apache-2.0
"""Vertices of PLY files, ASCII and binary in both byte orders.

Own reader, because trimesh (5.2) accepts ASCII files with fewer vertices than declared, rejects binary files with
mixed polygons or a trailing newline, and opens image files that a comment names.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import CloudReadError
from doorstate.io.size_limits import check_size
from doorstate.io.text_rows import parse_rows

_HEADER = re.compile(rb"\Aply\s.*?^end_header[ \t]*(?:\r\n|\n|\r|\Z)", re.DOTALL | re.MULTILINE)
_BYTE_ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
# Names of Turk's description (1994), then the sized names of other writers.
_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
    "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float32": "f4", "float64": "f8",
}  # fmt: skip


@dataclass
class _Element:
    name: str
    count: int
    properties: list[tuple[str, str]] = field(default_factory=list)  # (name, type)

    def record(self, byte_order: str) -> np.dtype[np.void]:
        """Return the layout of one element in a binary file."""
        for name, kind in self.properties:
            if kind not in _TYPES:
                raise CloudReadError(
                    f"has {kind} values ({self.name} {name}) in or before its vertices", expected="numbers"
                )
        return np.dtype([(name, byte_order + _TYPES[kind]) for name, kind in self.properties])


def parse_ply(data: bytes) -> NDArray[Any]:
    """Read x, y, z of the element `vertex`; other properties and elements are skipped.

    Returns:
        (N, 3) in file order and units, NaN kept.

    Raises:
        CloudReadError: there are no such vertices, or fewer than the header declares.
    """
    header = _HEADER.match(data)
    if header is None:
        raise CloudReadError("is not a PLY file", expected="a header from ply to end_header")
    byte_order, elements = _read_header(header[0].decode("ascii", errors="replace"))
    place = next((place for place, element in enumerate(elements) if element.name == "vertex"), None)
    if place is None:
        raise CloudReadError("has no element vertex")
    before, vertex = elements[:place], elements[place]
    names = [name for name, _ in vertex.properties]
    if not {"x", "y", "z"} <= set(names):
        raise CloudReadError(f"has vertices of {', '.join(names) or 'nothing'}", expected="x, y and z")
    record = vertex.record(byte_order)
    body = data[header.end() :]
    if byte_order == _BYTE_ORDERS["ascii"]:
        skip = sum(element.count for element in before)
        return parse_rows(body, [names.index(axis) for axis in "xyz"], vertex.count, skip)
    offset = sum(element.count * element.record(byte_order).itemsize for element in before)
    check_size(vertex.count * record.itemsize, len(body) - offset, "bytes")
    vertices = np.ndarray(vertex.count, record, buffer=body, offset=offset)
    return np.stack([vertices[axis] for axis in "xyz"], axis=-1)  # (N, 3)


def _read_header(text: str) -> tuple[str, list[_Element]]:
    byte_order = None
    elements: list[_Element] = []
    for line in text.splitlines():
        match line.split():
            case ["format", encoding, _]:
                byte_order = _BYTE_ORDERS.get(encoding)
            case ["element", name, count] if count.isdecimal():
                elements.append(_Element(name, int(count)))
            case ["property", "list", _, _, name] if elements:
                elements[-1].properties.append((name, "list"))
            case ["property", kind, name] if elements:
                elements[-1].properties.append((name, kind))
    if byte_order is None:
        raise CloudReadError("has no line format", expected=" or ".join(_BYTE_ORDERS))
    return byte_order, elements
