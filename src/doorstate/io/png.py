# SPDX-License-Identifier: Apache-2.0
"""Depth images as grey PNG: 16 bit, and 8 bit for data sets that define their depth steps."""

from __future__ import annotations

import io
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from doorstate.errors import CloudReadError
from doorstate.io.size_limits import check_point_count

# PNG specification, IHDR: the first chunk holds width, height, bit depth and colour type (0 is grey).
_HEADER = struct.Struct(">8s4x4sIIBB")
SIGNATURE = b"\x89PNG\r\n\x1a\n"
# zlib's technical notes: deflate packs at most 1032 bytes into one.
_MAX_EXPANSION = 1032


def parse_depth_png(data: bytes) -> NDArray[np.uint16]:
    """Read the pixels of a 16-bit grey PNG.

    Returns:
        (H, W) as stored.

    Raises:
        CloudReadError: no PNG, a colour or 8-bit image, or damaged.
    """
    bits, colour_type = _check(data)
    if colour_type != 0:
        raise CloudReadError("is a colour image", expected="a grey depth image with 16 bit")
    if bits != 16:
        raise CloudReadError(
            f"is an image with {bits} bit, {2**bits} depth steps", expected="a grey depth image with 16 bit"
        )
    pixels = _pixels(data)
    if pixels.ndim != 2 or pixels.dtype.itemsize < 2:  # Pillow takes the last of several headers
        raise CloudReadError("is a damaged PNG image: it has two headers")
    return pixels.astype(np.uint16)


def parse_coarse_png(data: bytes) -> NDArray[np.uint8]:
    """Read the pixels of an 8-bit grey PNG, also of one stored as colour with three equal channels.

    Returns:
        (H, W) as stored.

    Raises:
        CloudReadError: no PNG, colours or another number of bits, or damaged.
    """
    bits, colour_type = _check(data)
    if bits != 8:
        raise CloudReadError(f"is an image with {bits} bit", expected="8 bit, as in this data set")
    if colour_type not in (0, 2):
        raise CloudReadError("is not a grey image")
    pixels = _pixels(data).astype(np.uint8)
    if pixels.ndim == 3:
        if (pixels != pixels[..., :1]).any():
            raise CloudReadError("is a colour image", expected="a grey depth image")
        pixels = pixels[..., 0]
    return pixels


def _check(data: bytes) -> tuple[int, int]:
    """Return bits per channel and colour type of a PNG, after checking its declared size."""
    if len(data) < _HEADER.size:
        raise CloudReadError("is not a PNG image")
    signature, chunk, width, height, bits, colour_type = _HEADER.unpack_from(data)
    if signature != SIGNATURE or chunk != b"IHDR":
        raise CloudReadError("is not a PNG image")
    if bits * width * height > 8 * _MAX_EXPANSION * len(data):
        raise CloudReadError(
            f"is truncated: {width} x {height} pixels are declared, {len(data)} bytes are there"
        )
    check_point_count(width * height)
    return bits, colour_type


def _pixels(data: bytes) -> NDArray[Any]:
    try:
        with Image.open(io.BytesIO(data), formats=["PNG"]) as image:
            return np.asarray(image)
    except Exception as error:  # on damaged bytes Pillow raises exceptions of any type
        raise CloudReadError(f"is a damaged PNG image ({type(error).__name__}: {error})") from error
