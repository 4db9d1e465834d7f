# SPDX-License-Identifier: Apache-2.0
"""Depth images of ROS messages (Image, CompressedImage), read as pixels without ROS."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import CloudReadError
from doorstate.io.png import SIGNATURE as PNG_SIGNATURE
from doorstate.io.png import parse_depth_png
from doorstate.io.pointcloud2 import MessageBytes
from doorstate.io.rvl import parse_rvl
from doorstate.io.size_limits import check_point_count, check_size

DEPTH_ENCODINGS = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}
_TRANSPORT = "compressedDepth"
# compressed_depth_image_transport, compression_common.h: format, and the two parameters of inverse depth.
_PARAMETERS = struct.Struct("<iff")


def pixels_from_image(
    height: int, width: int, encoding: str, is_bigendian: bool, step: int, data: MessageBytes
) -> NDArray[Any]:
    """Read a sensor_msgs/Image of depth.

    Args:
        height, width: rows and columns.
        encoding: 16UC1, mono16 or 32FC1.
        is_bigendian: byte order of the pixels.
        step: bytes from a row to the next.
        data: the pixels.

    Returns:
        (height, width) uint16 (millimetres by ROS REP 118) or float32 (metres), as stored.

    Raises:
        CloudReadError: another kind of image, or fields that contradict each other.
    """
    check_encoding(encoding)
    dtype = np.dtype(DEPTH_ENCODINGS[encoding]).newbyteorder(">" if is_bigendian else "<")
    if min(height, width) < 1 or width * dtype.itemsize > step:
        raise CloudReadError(f"is damaged: {height} rows of {width} pixels in {step} bytes are declared")
    check_point_count(height * width)
    content = np.frombuffer(data, np.uint8)
    check_size(height * step, len(content), "bytes")
    pixels: NDArray[Any] = np.ndarray((height, width), dtype, content, strides=(step, dtype.itemsize))
    return pixels.astype(dtype.newbyteorder("="))


def pixels_from_compressed_depth(image_format: str, data: MessageBytes) -> NDArray[Any]:
    """Read a sensor_msgs/CompressedImage of depth, by the image transport `compressedDepth` or as a plain PNG.

    Args:
        image_format: such as `16UC1; compressedDepth png`, `16UC1; compressedDepth rvl` or `16UC1; png compressed`.
        data: of `compressedDepth`, twelve bytes of parameters before the PNG or RVL data.

    Returns:
        (H, W) like `pixels_from_image`; `compressedDepth` of 32FC1 holds inverse depth, NaN where it is 0.

    Raises:
        CloudReadError: another kind of image or compression, or damaged.
    """
    check_compressed_format(image_format)
    content = bytes(data)
    if _TRANSPORT not in image_format:
        return parse_depth_png(content)
    packed = content[_PARAMETERS.size :]
    # Some drivers name RVL and write PNG.
    is_rvl = "rvl" in image_format.lower() and not packed.startswith(PNG_SIGNATURE)
    stored = parse_rvl(packed) if is_rvl else parse_depth_png(packed)
    if DEPTH_ENCODINGS[_encoding(image_format)] == "u2":
        return stored
    _, quant_a, quant_b = _PARAMETERS.unpack_from(content)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        depth_m = quant_a / (stored.astype(np.float32) - np.float32(quant_b))
    return np.where(stored > 0, depth_m, np.float32(np.nan)).astype(np.float32)


def check_encoding(encoding: str) -> None:
    """Check that images of this encoding are depth images.

    Raises:
        CloudReadError: they are not.
    """
    if encoding not in DEPTH_ENCODINGS:
        raise CloudReadError(
            f"is an image in {encoding or 'no encoding'}, not depth", expected=", ".join(DEPTH_ENCODINGS)
        )


def check_compressed_format(image_format: str) -> None:
    """Check that compressed images of this format are depth images that can be read.

    Raises:
        CloudReadError: they are not.
    """
    compression = image_format.partition(";")[2].lower()
    if _TRANSPORT not in image_format:
        if "png" not in compression or DEPTH_ENCODINGS.get(_encoding(image_format)) != "u2":
            raise CloudReadError(
                f"is an image compressed as {image_format!r}, not depth",
                expected="compressedDepth, or PNG of 16 bit",
            )
    elif not set(compression.split()) <= {_TRANSPORT.lower(), "png", "rvl"}:
        raise CloudReadError(f"is depth compressed as {image_format!r}", expected="PNG or RVL")
    check_encoding(_encoding(image_format))


def _encoding(image_format: str) -> str:
    return image_format.partition(";")[0].strip()
