# SPDX-License-Identifier: Apache-2.0
"""Hypothesis strategies: damaged bytes, reading options, and ROS messages with impossible numbers."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
from hypothesis import strategies as st

from doorstate.io.camera import Intrinsics
from doorstate.io.options import ReadOptions
from tests.fuzz.examples import CAMERA, CLOUDS, HEIGHT, WIDTH, depth_of, files, rvl_of

_TOKENS = (b"0", b"9", b"-1", b"99999999999", b"nan", b"\n", b" ", b",", b"x", b"#", b"\xff" * 4, b"\0" * 4)
YAML_TOKENS = (
    b"&a ",
    b"*a",
    b"<<: ",
    b"!!python/name:os.system ",
    b"!!binary ",
    b": ",
    b"- ",
    b"[",
    b"{",
    b"'",
)
_NUMBERS = (b"-1", b"0", b"1", b"2147483648", b"9223372036854775808", b"1" + b"0" * 30, b"nan", b"1e9", b"")
_SIZES = (-1, 0, 1, 2, 3, 11, 12, 16, 80, 960, 65535, 2**31 - 1, 2**31, 2**32 - 1)
_HEADER_BYTES = 300
_RVL = ("16UC1; compressedDepth rvl",) * 3

HEADER = SimpleNamespace(frame_id="camera_link")
OPTIONS = st.builds(
    ReadOptions,
    axes=st.sampled_from(["auto", "ros", "optical", "opengl"]),
    roll_deg=st.sampled_from([0, 90, 180, 33.3]),
    pitch_deg=st.sampled_from([0, -20.5, 90]),
    ignore_viewpoint=st.booleans(),
    intrinsics=st.sampled_from(
        [CAMERA, None, Intrinsics(WIDTH, HEIGHT, *CAMERA), Intrinsics(2, 1, 1, 1, 0, 0)]
    ),
    depth_scale_m=st.sampled_from([0.001, 1e-300, 1e300]),
    units_m=st.sampled_from([1.0, 0.001, 1000.0]),
)


def damaged(examples: Sequence[bytes], tokens: Sequence[bytes] = ()) -> st.SearchStrategy[bytes]:
    """Valid files, files with up to four edits, and random bytes."""
    example = st.sampled_from(examples)
    return example | st.builds(_edit, example, _edits(tokens)) | st.binary(max_size=400)


def _edits(tokens: Sequence[bytes]) -> st.SearchStrategy[list[tuple[str, int, bytes]]]:
    # Most formats have their sizes and types at the start or at the end.
    place = st.integers(-_HEADER_BYTES, _HEADER_BYTES) | st.integers(0, 2**16)
    content = st.sampled_from((*_TOKENS, *tokens)) | st.binary(min_size=1, max_size=8)
    edit = st.tuples(st.sampled_from(["replace", "insert", "delete", "truncate"]), place, content)
    number = st.tuples(st.just("number"), place, st.sampled_from(_NUMBERS))
    return st.lists(edit | number, min_size=1, max_size=4)


def _edit(data: bytes, edits: Sequence[tuple[str, int, bytes]]) -> bytes:
    for kind, place, content in edits:
        start = place % (len(data) + 1)
        end = min(start + len(content), len(data))
        match kind:
            case "replace":
                data = data[:start] + content + data[end:]
            case "insert":
                data = data[:start] + content + data[start:]
            case "delete":
                data = data[:start] + data[end:]
            case "truncate":
                data = data[:start]
            case "number":
                numbers = list(re.finditer(rb"\d+", data[:_HEADER_BYTES]))
                if numbers:
                    number = numbers[place % len(numbers)]
                    data = data[: number.start()] + content + data[number.end() :]
    return data


def with_checksums(png: bytes) -> bytes:
    """Return a PNG with correct checksums, as far as its chunks can be told apart."""
    fixed, place = png[:8], 8
    while place + 12 <= len(png):
        size = int.from_bytes(png[place : place + 4], "big")
        chunk = png[place + 4 : place + 8 + size]
        fixed += png[place : place + 4] + chunk + struct.pack(">I", zlib.crc32(chunk))
        place += 12 + size
    return fixed + png[place:]


def png_files() -> st.SearchStrategy[bytes]:
    data = damaged(files(".png"))
    return data | data.map(with_checksums)


@st.composite
def cloud_messages(draw: st.DrawFn) -> SimpleNamespace:
    """sensor_msgs/PointCloud2."""
    points = draw(st.sampled_from(CLOUDS))
    height, width = points.shape[:2] if points.ndim == 3 else (1, len(points))
    names = [draw(st.sampled_from([axis, axis, axis, "intensity", "\udcff", ""])) for axis in "xyz"]
    fields = [
        SimpleNamespace(
            name=name,
            offset=draw(_mostly(4 * place, *_SIZES)),
            datatype=draw(_mostly(7, 8, 2, 0, 255)),
            count=draw(_mostly(1, 0, 3)),
        )
        for place, name in enumerate(names)
    ]
    sizes = {"height": height, "width": width, "point_step": 12, "row_step": 12 * width}
    return draw(_messages(sizes, points.astype("<f4").tobytes(), {"fields": fields, "header": HEADER}))


@st.composite
def image_messages(draw: st.DrawFn) -> SimpleNamespace:
    """sensor_msgs/Image."""
    encoding = draw(st.sampled_from(["16UC1", "mono16", "32FC1", "rgb8", "", "\udcff"]))
    pixels = depth_of(draw(st.sampled_from(CLOUDS)), "<f4" if encoding == "32FC1" else "<u2")
    sizes = {"height": pixels.shape[0], "width": pixels.shape[1], "step": pixels.shape[1] * pixels.itemsize}
    return draw(_messages(sizes, pixels.tobytes(), {"encoding": encoding}))


def compressed_messages() -> st.SearchStrategy[SimpleNamespace]:
    """sensor_msgs/CompressedImage."""
    png, formats = (
        "16UC1; compressedDepth png",
        ["32FC1; compressedDepth", *_RVL, "32FC1; compressedDepth rvl", "16UC1; png compressed", "jpeg", ""],
    )
    parameters = st.binary(min_size=12, max_size=12) | st.just(np.array([0, 100, 1], "<f4").tobytes())
    rvl = damaged([rvl_of(points) for points in CLOUDS])
    data = st.builds(bytes.__add__, parameters, png_files() | rvl) | png_files() | st.binary(max_size=20)
    return st.builds(SimpleNamespace, format=_mostly(png, *formats), data=data)


@st.composite
def _messages(draw: st.DrawFn, sizes: dict[str, int], data: bytes, fields: dict[str, Any]) -> SimpleNamespace:
    numbers = {name: draw(_mostly(size, *_SIZES)) for name, size in sizes.items()}
    content = draw(st.just(data) | damaged([data]))
    return SimpleNamespace(**numbers, **fields, is_bigendian=draw(st.booleans()), data=content)


def _mostly(usual: Any, *unusual: Any) -> st.SearchStrategy[Any]:
    return st.sampled_from([usual] * (2 * len(unusual)) + list(unusual))
