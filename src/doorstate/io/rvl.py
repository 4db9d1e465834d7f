# SPDX-License-Identifier: Apache-2.0
"""Depth images compressed as RVL: runs of zeros, and differences of the pixels between them.

Source: A. D. Wilson, "Fast lossless depth image compression", ISS 2017; image size as in ROS image_transport_plugins,
compressed_depth_image_transport, src/codec.cpp and src/rvl_codec.cpp.
"""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import CloudReadError
from doorstate.io.size_limits import check_point_count, check_size

_SIZE = struct.Struct("<II")  # columns, rows
# A pixel takes at most two run lengths of one nibble and a difference of six.
_MAX_PIXEL_BYTES = 4
_MAX_NIBBLES = 10  # of a number of 29 bits


def parse_rvl(data: bytes) -> NDArray[np.uint16]:
    """Read the pixels of an image of 16 bit, compressed as RVL after its number of columns and rows.

    Returns:
        (H, W) as stored.

    Raises:
        CloudReadError: truncated, or the runs do not fill the image.
    """
    check_size(_SIZE.size, len(data), "bytes")
    width, height = _SIZE.unpack_from(data)
    check_point_count(width * height)
    if width * height == 0:
        raise CloudReadError(f"is damaged: an image of {width} x {height} pixels is declared")
    # Bytes that no encoder writes are not looked at.
    content = data[_SIZE.size :][: _MAX_PIXEL_BYTES * (width * height + 4)]
    numbers = _numbers(content)
    pixels = np.zeros(width * height, np.uint16)
    filled, taken = _runs(numbers, len(pixels))
    differences = (numbers[taken] >> 1) ^ -(numbers[taken] & 1)
    pixels[filled] = np.cumsum(differences).astype(np.uint16)
    return pixels.reshape(height, width)


def _numbers(content: bytes) -> NDArray[np.int64]:
    """Return the numbers in a stream of 32-bit words: three bits a nibble, the lowest first, and a bit for more."""
    words = np.frombuffer(content[: len(content) // 4 * 4], "<u4").astype(">u4")
    halves = np.frombuffer(words.tobytes(), np.uint8)
    nibbles = np.stack([halves >> 4, halves & 15], axis=-1).ravel()
    ends = np.flatnonzero(nibbles < 8)
    starts = np.concatenate([[0], ends[:-1] + 1]) if len(ends) else ends
    if (ends - starts >= _MAX_NIBBLES).any():
        raise CloudReadError("is damaged RVL data: a number is too long")
    place = np.arange(ends[-1] + 1 if len(ends) else 0)
    places_in_number = place - np.repeat(starts, ends - starts + 1)
    bits = (nibbles[: len(place)] & 7).astype(np.int64) << 3 * places_in_number
    return np.add.reduceat(bits, starts) if len(starts) else np.empty(0, np.int64)


def _runs(numbers: NDArray[np.int64], count: int) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return a mask of the pixels that are not in runs of zeros, and one of the numbers that are their differences."""
    filled, taken = np.zeros(count, bool), np.zeros(len(numbers), bool)
    pixel = place = 0
    while pixel < count:
        check_size(place + 2, len(numbers), "numbers of RVL")
        zeros, others = int(numbers[place]), int(numbers[place + 1])
        place += 2
        pixel += zeros
        if pixel + others > count:
            raise CloudReadError(f"is damaged RVL data: its runs are longer than {count} pixels")
        check_size(place + others, len(numbers), "numbers of RVL")
        filled[pixel : pixel + others] = True
        taken[place : place + others] = True
        pixel += others
        place += others
    return filled, taken
