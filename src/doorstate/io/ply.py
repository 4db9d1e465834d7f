# SPDX-License-Identifier: Apache-2.0
"""Vertices of PLY files, ASCII and binary in both byte orders.

Own reader, because trimesh (5.2) accepts ASCII files with fewer vertices than declared, rejects binary files with
mixed polygons or a trailing newline, and opens image files that a comment names.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import CloudReadError
from doorstate.io.ply_elements import NUMBER_TYPES, Element, Property, Records
from doorstate.io.size_limits import check_point_count
from doorstate.io.text_rows import parse_rows

_MAX_HEADER = 1 << 20
_HEADER = re.compile(rb"\Aply[ \t]*(\r\n|\n|\r).*?[\r\n]end_header[ \t]*(\r\n|\n|\r|\Z)", re.DOTALL)
_BYTE_ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}


def parse_ply(data: bytes) -> NDArray[Any]:
    """Read x, y, z of the element `vertex`; other properties, lists among them, and other elements are skipped.

    Returns:
        (N, 3) in file order and units, NaN kept.

    Raises:
        CloudReadError: there are no such vertices, or fewer than the header declares.
    """
    header = _HEADER.match(data, 0, _MAX_HEADER)
    if header is None:
        raise CloudReadError("is not a PLY file", expected="a header from ply to end_header")
    # In a binary file whose lines end with \r alone, a following \n is the first byte of the vertices.
    start = header.end() - (header[1] == b"\r" and header[2] == b"\r\n")
    byte_order, elements = _read_header(header[0].decode("ascii", errors="replace"))
    place = next((place for place, element in enumerate(elements) if element.name == "vertex"), None)
    if place is None:
        raise CloudReadError("has no element vertex", expected="vertices with x, y and z")
    before, vertex = elements[:place], elements[place]
    names = [prop.name for prop in vertex.properties]
    if not {"x", "y", "z"} <= {prop.name for prop in vertex.properties if prop.count_kind is None}:
        raise CloudReadError(f"has vertices of {', '.join(names) or 'nothing'}", expected="x, y and z")
    check_point_count(vertex.records)
    axes = [names.index(axis) for axis in "xyz"]
    if byte_order == _BYTE_ORDERS["ascii"]:
        skip = sum(element.records for element in before)
        lines = header[0].count(header[1])
        return _parse_ascii(data[start:], vertex.properties, axes, vertex.records, skip, lines + 1)
    for element in before:
        start = Records(element, data, start, byte_order).end
    vertices = Records(vertex, data, start, byte_order)
    return np.stack([vertices.values(axis) for axis in axes], axis=-1)  # (N, 3)


def _parse_ascii(
    body: bytes, properties: Sequence[Property], axes: Sequence[int], count: int, skip: int, first_line: int
) -> NDArray[np.float64]:
    lists = [place for place, prop in enumerate(properties) if prop.count_kind is not None]
    if not lists or min(lists) > max(axes):
        return parse_rows(body, axes, count, skip, first_line)

    def without_lists(row: str) -> str:
        cells = row.split()
        for place in lists:
            length = cells[place] if place < len(cells) else "0"
            if not (length.isdecimal() and len(length) < 10):
                raise CloudReadError(f"is {length[:40]!r} long", field=properties[place].name)
            del cells[place + 1 : place + 1 + int(length)]
        return " ".join(cells)

    return parse_rows(body, axes, count, skip, first_line, without_lists)


def _read_header(text: str) -> tuple[str, list[Element]]:
    byte_order = None
    elements: list[Element] = []
    for line in text.splitlines():
        match line.split():
            case ["format", encoding, _]:
                byte_order = _BYTE_ORDERS.get(encoding)
            case ["element", name, count] if count.isdecimal() and len(count) <= 18:
                elements.append(Element(name, int(count), []))
            case ["property", "list", count_kind, kind, name] if elements:
                elements[-1].properties.append(_property(name, kind, count_kind))
            case ["property", kind, name] if elements:
                elements[-1].properties.append(_property(name, kind, None))
    if byte_order is None:
        raise CloudReadError("has no line format", expected=" or ".join(_BYTE_ORDERS))
    return byte_order, elements


def _property(name: str, kind: str, count_kind: str | None) -> Property:
    for given in (kind, count_kind or "uchar"):
        if given not in NUMBER_TYPES:
            raise CloudReadError(f"has {given} values", field=name, expected=" ".join(NUMBER_TYPES))
    if count_kind is not None and NUMBER_TYPES[count_kind].startswith("f"):
        raise CloudReadError(f"has a length of type {count_kind}", field=name, expected="a whole number")
    return Property(name, NUMBER_TYPES[kind], None if count_kind is None else NUMBER_TYPES[count_kind])
