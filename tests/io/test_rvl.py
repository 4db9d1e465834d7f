# SPDX-License-Identifier: Apache-2.0
"""RVL against the encoder of the paper; damaged data."""

from __future__ import annotations

import struct
import time
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from numpy.typing import NDArray

from doorstate.errors import CloudReadError
from doorstate.io.rvl import parse_rvl
from doorstate.io.size_limits import MAX_POINTS
from tests.rvl import Nibbles, encode

_pixels = st.sampled_from([0, 0, 1, 65535]) | st.integers(0, 65535)


@given(npst.arrays(np.uint16, npst.array_shapes(min_dims=2, max_dims=2, max_side=9), elements=_pixels))
@settings(max_examples=200)
def test_every_image_survives(pixels: NDArray[np.uint16]) -> None:
    data = encode(pixels)
    for stored in (data, data + b"\xff" * 9, data + bytes(3)):
        read = parse_rvl(stored)
        assert read.dtype == np.uint16
        np.testing.assert_array_equal(read, pixels)


def test_a_camera_frame_takes_milliseconds() -> None:
    rng = np.random.default_rng(0)
    pixels = np.cumsum(rng.integers(-3, 4, (480, 640)), axis=1).astype(np.uint16) + np.uint16(2000)
    pixels[rng.random(pixels.shape) < 0.05] = 0
    data = encode(pixels)
    started = time.process_time()
    np.testing.assert_array_equal(parse_rvl(data), pixels)
    assert time.process_time() - started < 0.5


_GOOD = encode(np.full((4, 5), 1000, np.uint16))


@pytest.mark.parametrize(
    "data",
    [
        b"",
        _GOOD[:7],
        _GOOD[:8],
        _GOOD[:-4],
        struct.pack("<II", 0, 5) + bytes(40),
        struct.pack("<II", 2**32 - 1, 2**32 - 1) + bytes(40),
        struct.pack("<II", 6, 1) + _GOOD[8:],
        struct.pack("<II", 5, 4) + b"\xff" * 400,
        struct.pack("<II", 5, 4) + bytes(400),
    ],
)
def test_damaged_data_is_refused(data: bytes) -> None:
    with pytest.raises(CloudReadError):
        parse_rvl(data)


def test_a_few_bytes_of_zeros_unpack_to_no_more_than_an_image() -> None:
    stream = Nibbles()
    stream.write(MAX_POINTS)
    stream.write(0)
    data = struct.pack("<II", MAX_POINTS // 8, 8) + stream.content()
    tracemalloc.start()
    try:
        assert not parse_rvl(data).any()
        assert tracemalloc.get_traced_memory()[1] < 4 * MAX_POINTS
    finally:
        tracemalloc.stop()
