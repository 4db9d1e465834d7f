# SPDX-License-Identifier: Apache-2.0
"""PLY files by trimesh and by hand, in all encodings, with other elements around the vertices."""

from __future__ import annotations

import struct

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from numpy.typing import NDArray

from doorstate.errors import CloudReadError
from doorstate.io.ply import parse_ply

NAN = np.nan
POINTS = np.array([[1.5, -2.25, 3.125], [NAN, NAN, NAN], [0.5, 0.25, -8.0]], np.float32)
ROWS = "1.5 -2.25 3.125\nnan nan nan\n0.5 0.25 -8\n"
XYZ = "property float x\nproperty float y\nproperty float z\n"


def _header(encoding: str, elements: str) -> bytes:
    return f"ply\nformat {encoding} 1.0\ncomment by hand\n{elements}end_header\n".encode()


_FLOATS = st.floats(width=32, allow_nan=True)
VERTICES = f"element vertex 3\n{XYZ}"
LIST_FIRST = VERTICES.replace("property float x", "property list uchar int k\nproperty float x")
FACES = "element face 2\nproperty list uchar int vertex_indices\n"
MIXED_FACES = struct.pack("<B3i", 3, 0, 1, 2) + struct.pack("<B4i", 4, 0, 1, 2, 0)


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian"])
def test_reads_what_trimesh_writes(encoding: str) -> None:
    vertices = np.array([[0, 0, 0], [1.5, 0, 0], [0, 2.5, 0.25], [0, 0, 0]], np.float32)
    colours = np.array([[1, 2, 3, 255]] * 4, np.uint8)
    cloud = trimesh.PointCloud(vertices, colors=colours)  # type: ignore[no-untyped-call]
    mesh = trimesh.Trimesh(vertices, [[0, 1, 2], [3, 1, 2]], process=False)
    for thing in (cloud, mesh):
        data = thing.export(file_type="ply", encoding=encoding)
        assert isinstance(data, bytes)
        np.testing.assert_array_equal(parse_ply(data), vertices)


@given(npst.arrays(np.float32, st.tuples(st.integers(0, 12), st.just(3)), elements=st.floats(width=32)))
@settings(max_examples=50)
def test_every_float32_survives_every_encoding(points: NDArray[np.float32]) -> None:
    elements = VERTICES.replace("3", str(len(points)))
    rows = "".join(" ".join(f"{value:.9g}" for value in row) + "\n" for row in points.tolist())
    for data in (
        _header("ascii", elements) + rows.encode(),
        _header("binary_little_endian", elements) + points.astype("<f4").tobytes(),
        _header("binary_big_endian", elements) + points.astype(">f4").tobytes(),
    ):
        np.testing.assert_array_equal(parse_ply(data).astype(np.float32), points)


@pytest.mark.parametrize(("encoding", "order"), [("binary_little_endian", "<"), ("binary_big_endian", ">")])
def test_other_properties_and_elements_are_skipped(encoding: str, order: str) -> None:
    elements = (
        "obj_info made by hand\nelement camera 2\nproperty double f\nproperty uchar id\nelement vertex 3\n"
        "property uchar red\nproperty double z\nproperty float32 x\nproperty int16 label\nproperty float y\n"
        + FACES
    )
    cameras = np.zeros(2, [("f", f"{order}f8"), ("id", "u1")])
    kinds = {"red": "u1", "z": f"{order}f8", "x": f"{order}f4", "label": f"{order}i2", "y": f"{order}f4"}
    vertices = np.zeros(3, list(kinds.items()))
    vertices["x"], vertices["y"], vertices["z"] = POINTS.T
    data = _header(encoding, elements) + cameras.tobytes() + vertices.tobytes() + MIXED_FACES
    np.testing.assert_array_equal(parse_ply(data), POINTS)


_lists = st.lists(st.integers(-(2**15), 2**15 - 1), max_size=3)


@given(st.data(), st.sampled_from(["ascii", "binary_little_endian", "binary_big_endian"]))
@settings(max_examples=150)
def test_lists_before_between_and_after_are_skipped(data: st.DataObject, encoding: str) -> None:
    points = data.draw(npst.arrays(np.float32, st.tuples(st.integers(1, 6), st.just(3)), elements=_FLOATS))
    lengths = data.draw(st.sampled_from(["uchar", "ushort", "int", "uint8"]))
    order = data.draw(st.permutations(["x", "y", "z", "k", "l", "red"]))
    is_uniform, uniform = data.draw(st.booleans()), data.draw(_lists)
    mark = ">" if "big" in encoding else "<"
    codes = {"uchar": "B", "uint8": "B", "ushort": "H", "int": "i"}
    text, binary = [], b""
    for row in points.tolist():
        cells: list[str] = []
        for name in order:
            if name in "kl":
                items = uniform if is_uniform else data.draw(_lists)
                cells += [str(len(items)), *map(str, items)]
                binary += struct.pack(f"{mark}{codes[lengths]}{len(items)}h", len(items), *items)
            elif name == "red":
                cells.append("255")
                binary += b"\xff"
            else:
                value = row["xyz".index(name)]
                cells.append(f"{value:.9g}")
                binary += struct.pack(f"{mark}f", value)
        text.append(" ".join(cells) + "\n")
    kinds = {"k": f"list {lengths} short", "l": f"list {lengths} int16", "red": "uchar"}
    properties = "".join(f"property {kinds.get(name, 'float')} {name}\n" for name in order)
    header = _header(encoding, f"element vertex {len(points)}\n{properties}")
    body = "".join(text).encode() if encoding == "ascii" else binary
    np.testing.assert_array_equal(parse_ply(header + body).astype(np.float32), points)


@pytest.mark.parametrize("end", ["\r", "\n", "\r\n"])
def test_any_line_end_before_binary_vertices(end: str) -> None:
    elements = VERTICES.replace("float", "uchar")
    data = _header("binary_little_endian", elements).replace(b"\n", end.encode())
    np.testing.assert_array_equal(
        parse_ply(data + b"\n\r\n123456"), [[10, 13, 10], [49, 50, 51], [52, 53, 54]]
    )


@pytest.mark.parametrize(
    "data",
    [
        _header("ascii", VERTICES) + ROWS.encode(),
        _header("ascii", VERTICES).replace(b"\n", b"\r\n") + ROWS.replace("\n", " \r\n").encode(),
        _header("ascii", VERTICES).replace(b"\n", b"\r") + ROWS.replace("\n", "\r").encode(),
        _header("binary_little_endian", FACES + VERTICES) + MIXED_FACES + POINTS.tobytes(),
        _header("ascii", FACES + VERTICES) + b"3 0 1 2\n4 0 1 2 0\n" + ROWS.encode(),
        _header("ascii", VERTICES + FACES) + ROWS.encode() + b"3 0 1 2\n4 0 1 2 0\n",
        _header("binary_little_endian", VERTICES) + POINTS.tobytes() + b"\n",
        _header("binary_little_endian", VERTICES).replace(b"\n", b"\r\n") + POINTS.tobytes(),
    ],
    ids=[
        "plain",
        "crlf",
        "cr",
        "binary faces first",
        "faces first",
        "faces after",
        "trailing byte",
        "binary crlf",
    ],
)
def test_variants(data: bytes) -> None:
    np.testing.assert_array_equal(parse_ply(data), POINTS)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"plywood", "is not a PLY file"),
        (b"ply\nformat ascii 1.0\nelement vertex 3\n", "is not a PLY file"),
        (_header("ascii", FACES), "no element vertex"),
        (_header("middle_endian", VERTICES), "no line format"),
        (_header("ascii", VERTICES.replace("float z", "float w")), "x, y, w"),
        (_header("ascii", VERTICES.replace("float z", "quad z")), "quad values"),
        (_header("ascii", VERTICES.replace("float z", "list uchar float z")), "vertices of x, y, z"),
        (
            _header("ascii", VERTICES.replace("float z", "list float int k\nproperty float z")),
            "length of type",
        ),
        (_header("ascii", LIST_FIRST) + b"1 7 1 2 3\n-1 1 2 3\n", "'-1' long"),
        (
            _header("binary_little_endian", LIST_FIRST) + b"\0" * 12 + b"\1" + b"\0" * 12 + b"\1" * 13,
            "truncated",
        ),
        (_header("binary_little_endian", LIST_FIRST.replace("uchar", "char")) + b"\xff" * 60, "-1 values"),
        (_header("ascii", VERTICES) + b"1 2 3\n4 5 6\n", "3 points are declared, 2 are there"),
        (_header("ascii", VERTICES) + b"1 2 3\n4 5\n6 7 8\n", "line 10 has 2 columns"),
        (_header("binary_big_endian", VERTICES) + bytes(35), "36 bytes are declared, 35 are there"),
        (_header("binary_little_endian", FACES + VERTICES) + MIXED_FACES + bytes(35), "truncated"),
        (_header("binary_little_endian", FACES.replace("2", "9" * 15) + VERTICES) + bytes(36), "truncated"),
        (_header("binary_little_endian", VERTICES.replace("3", "9" * 15)) + bytes(36), "not one camera"),
        (_header("binary_little_endian", VERTICES.replace("3", "9" * 6)) + bytes(36), "truncated"),
    ],
)
def test_damaged_files_are_read_errors(data: bytes, reason: str) -> None:
    with pytest.raises(CloudReadError, match=reason):
        parse_ply(data)
