# SPDX-License-Identifier: Apache-2.0
"""Encoder of RVL depth images, as listed in A. D. Wilson, "Fast lossless depth image compression", ISS 2017."""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray


class Nibbles:
    """Stream of nibbles in 32-bit words, the first in the highest bits."""

    def __init__(self) -> None:
        self.words: list[int] = []
        self.word = self.written = 0

    def write(self, value: int) -> None:
        while True:
            nibble, value = value & 7, value >> 3
            self.word = self.word << 4 | nibble | (8 if value else 0)
            self.written += 1
            if self.written == 8:
                self.words.append(self.word)
                self.word = self.written = 0
            if not value:
                return

    def content(self) -> bytes:
        last = [self.word << 4 * (8 - self.written)] if self.written else []
        return struct.pack(f"<{len(self.words) + len(last)}I", *self.words, *last)


def encode(pixels: NDArray[np.uint16]) -> bytes:
    """Compress an image as CompressRVL of the paper does."""
    stream, values = Nibbles(), pixels.ravel().tolist()
    place, previous = 0, 0
    while place < len(values):
        start = place
        while place < len(values) and values[place] == 0:
            place += 1
        stream.write(place - start)
        end = place
        while end < len(values) and values[end] != 0:
            end += 1
        stream.write(end - place)
        for value in values[place:end]:
            delta = value - previous
            stream.write((delta << 1) ^ (delta >> 31))
            previous = value
        place = end
    return struct.pack("<II", pixels.shape[1], pixels.shape[0]) + stream.content()
