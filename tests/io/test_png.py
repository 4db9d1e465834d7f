# SPDX-License-Identifier: Apache-2.0
"""Depth PNG files by PIL; colour, 8-bit and damaged images."""

from __future__ import annotations

import io
import struct
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from numpy.typing import NDArray
from PIL import Image

from doorstate.errors import CloudReadError
from doorstate.io.png import parse_coarse_png, parse_depth_png


def _png(image: Image.Image) -> bytes:
    stream = io.BytesIO()
    image.save(stream, "PNG")
    return stream.getvalue()


@given(npst.arrays(np.uint16, npst.array_shapes(min_dims=2, max_dims=2, max_side=20)))
@settings(max_examples=50)
def test_round_trip(depth: NDArray[np.uint16]) -> None:
    pixels = parse_depth_png(_png(Image.fromarray(depth)))
    assert pixels.dtype == np.uint16
    np.testing.assert_array_equal(pixels, depth)


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "P", "LA"])
def test_colour_is_not_depth(mode: str) -> None:
    with pytest.raises(CloudReadError, match="colour"):
        parse_depth_png(_png(Image.new(mode, (20, 20))))


def test_eight_bits_are_not_depth() -> None:
    with pytest.raises(CloudReadError, match="256 depth steps"):
        parse_depth_png(_png(Image.new("L", (20, 20))))


@pytest.mark.parametrize("mode", ["L", "RGB"])
def test_a_second_header_is_refused(mode: str) -> None:
    header_end = 33
    deep, other = _png(Image.fromarray(np.ones((20, 20), np.uint16))), _png(Image.new(mode, (20, 20)))
    with pytest.raises(CloudReadError, match="two headers"):
        parse_depth_png(deep[:header_end] + other[8:])


def test_a_huge_declared_size_is_refused_before_decoding() -> None:
    data = bytearray(_png(Image.fromarray(np.ones((20, 20), np.uint16))))
    data[16:24] = struct.pack(">II", 30000, 30000)
    with pytest.raises(CloudReadError, match="30000 x 30000 pixels are declared"):
        parse_depth_png(bytes(data))


@pytest.mark.parametrize("data", [b"", b"P5 20 20 65535\n", bytes(100)])
def test_other_bytes_are_no_png(data: bytes) -> None:
    with pytest.raises(CloudReadError, match="not a PNG"):
        parse_depth_png(data)


@given(npst.arrays(np.uint8, npst.array_shapes(min_dims=2, max_dims=2, max_side=20)), st.booleans())
@settings(max_examples=50)
def test_eight_bits_are_read_as_coarse_depth(depth: NDArray[np.uint8], as_colour: bool) -> None:
    image = Image.fromarray(depth)
    pixels = parse_coarse_png(_png(image.convert("RGB") if as_colour else image))
    assert pixels.dtype == np.uint8
    np.testing.assert_array_equal(pixels, depth)


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (Image.new("RGB", (20, 20), (1, 1, 2)), "colour"),
        (Image.new("LA", (20, 20)), "not a grey image"),
        (Image.new("1", (20, 20)), "1 bit"),
        (Image.new("I;16", (20, 20)), "16 bit"),
    ],
)
def test_other_images_are_no_coarse_depth(image: Image.Image, message: str) -> None:
    with pytest.raises(CloudReadError, match=message):
        parse_coarse_png(_png(image))


@given(st.integers(0, 400), st.binary(max_size=30))
@settings(max_examples=50)
def test_damaged_coarse_images_are_read_or_refused(keep: int, rest: bytes) -> None:
    whole = _png(Image.fromarray(np.arange(400, dtype=np.uint8).reshape(20, 20)))
    with suppress(CloudReadError):
        assert parse_coarse_png(whole[:keep] + rest).ndim == 2
