# SPDX-License-Identifier: Apache-2.0
"""Elements of binary PLY files: records of numbers, and of lists whose lengths stand before their items."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import CloudReadError
from doorstate.io.size_limits import check_point_count, check_size

# Names of Turk's description (1994), then the sized names of other writers.
NUMBER_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
    "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float32": "f4", "float64": "f8",
}  # fmt: skip
_STRUCT_CODES = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I"}


class Property(NamedTuple):
    """Number, or list of numbers, of every record; types as numpy writes them."""

    name: str
    kind: str
    count_kind: str | None  # of the length of a list


class Element(NamedTuple):
    """Records of one kind."""

    name: str
    records: int
    properties: list[Property]


class Records:
    """Records of an element in binary data.

    Args:
        element: element to find.
        data: content of the file.
        start: place of the first record.
        byte_order: `<` or `>`.

    Raises:
        CloudReadError: the records are longer than the data.
    """

    def __init__(self, element: Element, data: bytes, start: int, byte_order: str) -> None:
        self._data, self._order, self._properties = data, byte_order, element.properties
        # Numbers between two lists are a block, whose start depends on the lengths of the lists before it.
        self._lists: list[
            tuple[int, struct.Struct, int]
        ] = []  # (bytes of the block before, length, bytes an item)
        self._places: list[tuple[int, int]] = []  # of every property: (block, offset)
        block = 0
        for prop in element.properties:
            self._places.append((len(self._lists), block))
            size = np.dtype(prop.kind).itemsize
            if prop.count_kind is None:
                block += size
            else:
                length = struct.Struct(byte_order + _STRUCT_CODES[prop.count_kind])
                self._lists.append((block, length, size))
                block = 0
        self._last_block = block
        smallest = sum(before + length.size for before, length, _ in self._lists) + block
        check_size(element.records * smallest, len(data) - start, "bytes")
        self._starts, self.end = self._find(element.records, start)

    def values(self, place: int) -> NDArray[Any]:
        """Return the numbers (records,) of a property that is no list."""
        kind = np.dtype(self._order + self._properties[place].kind)
        block, offset = self._places[place]
        starts = self._starts[:, block] + offset
        if len(starts) < 2 or (np.diff(starts) == starts[1] - starts[0]).all():
            stride = int(starts[1] - starts[0]) if len(starts) > 1 else kind.itemsize
            first = int(starts[0]) if len(starts) else 0
            return np.ndarray(len(starts), kind, self._data, first, (stride,)).copy()
        content = np.frombuffer(self._data, np.uint8)[starts[:, None] + np.arange(kind.itemsize)]
        return np.ascontiguousarray(content).view(kind)[:, 0]

    def _find(self, count: int, start: int) -> tuple[NDArray[np.int64], int]:
        """Return the starts (records, blocks) of all blocks, and the place after the last record."""
        if count == 0:
            return np.empty((0, len(self._lists) + 1), np.int64), start
        first, after = self._walk(start)
        stride = after - start
        if self._has_equal_lists(first, stride, count):
            steps = np.arange(count if stride else 1)[:, None] * stride
            return np.array(first) + steps, start + count * stride
        check_point_count(count)
        starts = np.empty((count, len(self._lists) + 1), np.int64)
        for record in range(count):
            starts[record], start = self._walk(start)
        return starts, start

    def _has_equal_lists(self, first: Sequence[int], stride: int, count: int) -> bool:
        """Return True if the lists of all records are as long as those of the first record."""
        if first[0] + count * stride > len(self._data):
            return False
        for block, (before, length, _) in enumerate(self._lists):
            place = first[block] + before
            lengths = np.ndarray(count, length.format, self._data, place, (stride,))
            if (lengths != lengths[0]).any():
                return False
        return True

    def _walk(self, place: int) -> tuple[list[int], int]:
        """Return the starts of the blocks of one record, and the place after it."""
        starts = []
        for before, length, item in self._lists:
            starts.append(place)
            place += before
            check_size(place + length.size, len(self._data), "bytes")
            (items,) = length.unpack_from(self._data, place)
            if items < 0:
                raise CloudReadError(f"is damaged: a list of {items} values is declared")
            place += length.size + items * item
        starts.append(place)
        check_size(place + self._last_block, len(self._data), "bytes")
        return starts, place + self._last_block
