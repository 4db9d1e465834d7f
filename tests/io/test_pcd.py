# SPDX-License-Identifier: Apache-2.0
"""PCD files exchanged with pypcd4; old, unusual and damaged headers."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from numpy.typing import NDArray
from pypcd4.pypcd4 import Encoding, PointCloud

from doorstate.errors import CloudContentError, CloudReadError
from doorstate.io.pcd import parse_pcd, write_pcd
from doorstate.io.pcd_header import IDENTITY, read_pcd_header
from tests.hand_made_clouds import image_of_a_rough_wall

NAN = np.nan
POINTS = np.array([[1.5, -2.25, 3.125], [NAN, NAN, NAN], [0.5, 0.25, -8.0]], np.float32)
HEADER = """# .PCD v0.7 - Point Cloud Data file format
VERSION 0.7
FIELDS x y z
SIZE 4 4 4
TYPE F F F
COUNT 1 1 1
WIDTH 3
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS 3
DATA ascii
"""
ROWS = "1.5 -2.25 3.125\nnan nan nan\n0.5 0.25 -8\n"

_clouds = npst.arrays(
    np.float32, st.tuples(st.integers(0, 20), st.just(3)), elements=st.floats(width=32, allow_nan=True)
)


@pytest.mark.parametrize("encoding", [Encoding.ASCII, Encoding.BINARY, Encoding.BINARY_COMPRESSED])
def test_reads_what_pypcd4_writes(tmp_path: Path, encoding: Encoding) -> None:
    columns = [np.arange(300, dtype=np.uint8), *np.tile(POINTS, (100, 1)).T[::-1], np.ones(300)]
    types = (np.uint8, np.float32, np.float32, np.float32, np.float64)
    cloud = PointCloud.from_points(columns, ("ring", "z", "y", "x", "stamp"), types)
    cloud.save(tmp_path / "a.pcd", encoding=encoding)
    np.testing.assert_array_equal(parse_pcd((tmp_path / "a.pcd").read_bytes()), np.tile(POINTS, (100, 1)))


@given(points=_clouds)
@settings(max_examples=50)
def test_every_float32_survives_writing_and_reading(
    tmp_path_factory: pytest.TempPathFactory, points: NDArray[np.float32]
) -> None:
    path = tmp_path_factory.mktemp("pcd") / "a.pcd"
    write_pcd(path, points)
    np.testing.assert_array_equal(parse_pcd(path.read_bytes()), points)


@given(points=_clouds)
@settings(max_examples=50)
def test_nine_digits_of_text_are_the_same_float32(points: NDArray[np.float32]) -> None:
    rows = "".join(" ".join(f"{value:.9g}" for value in row) + "\n" for row in points.tolist())
    data = HEADER.replace("POINTS 3", f"POINTS {len(points)}") + rows
    np.testing.assert_array_equal(parse_pcd(data.encode()).astype(np.float32), points)


def test_an_organized_cloud_keeps_its_width_and_height(tmp_path: Path) -> None:
    grid = np.arange(2 * 5 * 3, dtype=np.float32).reshape(2, 5, 3)
    grid[0, 1] = NAN
    write_pcd(tmp_path / "deep" / "grid.pcd", grid)
    cloud = PointCloud.from_path(tmp_path / "deep" / "grid.pcd")
    assert (cloud.metadata.width, cloud.metadata.height, cloud.metadata.points) == (5, 2, 10)
    np.testing.assert_array_equal(cloud.numpy(), grid.reshape(-1, 3))


def test_an_unorganized_cloud_is_one_row_and_compressed(tmp_path: Path) -> None:
    write_pcd(tmp_path / "flat.pcd", np.zeros((1000, 3), np.float32))
    cloud = PointCloud.from_path(tmp_path / "flat.pcd")
    assert (cloud.metadata.width, cloud.metadata.height) == (1000, 1)
    assert cloud.metadata.data is Encoding.BINARY_COMPRESSED
    assert [path.name for path in tmp_path.iterdir()] == ["flat.pcd"]


@pytest.mark.parametrize("shape", [(3,), (4, 2), (2, 2, 2, 3)])
def test_other_shapes_are_not_written(tmp_path: Path, shape: tuple[int, ...]) -> None:
    with pytest.raises(CloudContentError, match=r"a\.pcd"):
        write_pcd(tmp_path / "a.pcd", np.zeros(shape, np.float32))


@pytest.mark.parametrize(
    "text",
    [
        HEADER + ROWS,
        HEADER + ROWS.replace(" ", "  ").replace("\n", " \n"),
        (HEADER + ROWS).replace("\n", "\r\n"),
        (HEADER + ROWS).replace("\n", "\r"),
        HEADER.replace("FIELDS", "COLUMNS") + ROWS,
        HEADER.replace("SIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n", "") + ROWS,
        HEADER.replace("x y z", "_ x y z").replace("4 4 4", "1 4 4 4").replace("F F F", "U F F F")
        .replace("1 1 1", "0 1 1 1") + ROWS,
        HEADER.replace("0.7", ".5").replace("COUNT 1 1 1\n", "") + ROWS,
        HEADER.replace("POINTS 3\n", "").replace("VIEWPOINT 0 0 0 1 0 0 0\n", "") + ROWS,
        HEADER + ROWS + "7 8 9\n",
        HEADER.replace("x y z", "x y z label").replace("4 4 4", "4 4 4 4").replace("F F F", "F F F I")
        .replace("1 1 1", "1 1 1 1") + ROWS.replace("\n", " 2.5\n"),
        # A histogram of two values stands before the point.
        HEADER.replace("x y z", "h x y z").replace("4 4 4", "4 4 4 4").replace("F F F", "F F F F")
        .replace("1 1 1", "2 1 1 1") + "".join("9 9 " + row + "\n" for row in ROWS.splitlines()),
    ],
    ids=["plain", "blanks", "crlf", "cr", "columns", "no sizes", "count 0", "version 0.5", "no POINTS",
         "rows to spare", "float label", "histogram"],
)  # fmt: skip
def test_ascii_variants(text: str) -> None:
    np.testing.assert_array_equal(parse_pcd(text.encode()), POINTS)


def test_padding_and_repeated_fields_in_binary() -> None:
    header = (
        HEADER.replace("x y z", "_ x y z _ z").replace("4 4 4", "1 4 4 4 1 4").replace("F F F", "U F F F U F")
    )
    header = header.replace("COUNT 1 1 1", "COUNT 3 1 1 1 2 1").replace("ascii", "binary")
    rows = np.zeros(3, [("a", "u1", 3), ("xyz", "<f4", 3), ("b", "u1", 2), ("c", "<f4")])
    rows["xyz"] = POINTS
    np.testing.assert_array_equal(parse_pcd(header.encode() + rows.tobytes()), POINTS)


@pytest.mark.parametrize("end", ["\r", "\n", "\r\n"])
def test_any_line_end_before_binary_points(end: str) -> None:
    # Points that begin with the byte of a line end.
    points = np.array([[10, 13, 10], [1, 2, 3], [4, 5, 6]], "u1")
    header = HEADER.replace("4 4 4", "1 1 1").replace("F F F", "U U U").replace("ascii", "binary")
    header = header.replace("SIZE", "# sizes in bytes\nSIZE").replace("\n", end)
    np.testing.assert_array_equal(parse_pcd(header.encode() + points.tobytes()), points)


def test_fields_with_count_0_take_no_bytes() -> None:
    header = HEADER.replace("x y z", "x y z _ intensity").replace("4 4 4", "4 4 4 1 4")
    header = header.replace("F F F", "F F F U F").replace("COUNT 1 1 1", "COUNT 1 1 1 0 1")
    rows = np.hstack([POINTS, np.ones((3, 1), np.float32)])
    data = header.replace("ascii", "binary").encode() + rows.tobytes()
    np.testing.assert_array_equal(parse_pcd(data), POINTS)


def test_shuffled_points_of_an_organized_header_are_unorganized(tmp_path: Path) -> None:
    wall = image_of_a_rough_wall(60, 80)
    write_pcd(tmp_path / "wall.pcd", wall)
    np.testing.assert_array_equal(parse_pcd((tmp_path / "wall.pcd").read_bytes()), wall)
    shuffled = np.random.default_rng(0).permutation(wall.reshape(-1, 3))
    write_pcd(tmp_path / "shuffled.pcd", shuffled.reshape(60, 80, 3))
    np.testing.assert_array_equal(parse_pcd((tmp_path / "shuffled.pcd").read_bytes()), shuffled)


def test_the_viewpoint_is_read_from_the_header() -> None:
    moved = HEADER.replace("VIEWPOINT 0 0 0 1 0 0 0", "VIEWPOINT 1 -2.5 3e0 0.5 0.5 0.5 0.5")
    assert read_pcd_header(moved.encode()).viewpoint == (1, -2.5, 3, 0.5, 0.5, 0.5, 0.5)
    assert read_pcd_header(HEADER.replace("VIEWPOINT", "# ").encode()).viewpoint == IDENTITY


@pytest.mark.parametrize(
    ("line", "changed", "field"),
    [
        ("VIEWPOINT 0 0 0 1 0 0 0", "VIEWPOINT 0 0 0 1", "VIEWPOINT"),
        ("VIEWPOINT 0 0 0 1 0 0 0", "VIEWPOINT 0 0 0 1 0 0 nan", "VIEWPOINT"),
        ("POINTS 3", "POINTS " + "9" * 5000, "POINTS"),
        ("POINTS 3", "POINTS -3", "POINTS"),
        ("SIZE 4 4 4", "SIZE 4 2 4", "y"),
        ("TYPE F F F", "TYPE F F D", "z"),
        ("COUNT 1 1 1", "COUNT 3 1 1", "x"),
        ("COUNT 1 1 1", "COUNT 1 1 0", "z"),
    ],
)
def test_errors_name_the_entry_of_the_header(line: str, changed: str, field: str) -> None:
    with pytest.raises(CloudReadError) as caught:
        parse_pcd((HEADER.replace(line, changed) + ROWS).encode())
    assert caught.value.field == field


def test_no_points_are_no_rows() -> None:
    for encoding in ("ascii", "binary", "binary_compressed"):
        text = HEADER.replace("3\n", "0\n").replace("DATA ascii\n", f"DATA {encoding}")
        assert parse_pcd(text.encode()).shape == (0, 3)


_BINARY = HEADER.replace("ascii", "binary").encode()
_COMPRESSED = HEADER.replace("ascii", "binary_compressed").encode()


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"VERSION 0.7\nFIELDS x y z\n", "DATA"),
        (HEADER.replace("x y z", "x y intensity").encode(), "x y intensity"),
        (HEADER.replace("SIZE 4 4 4", "SIZE 4 4").encode(), "differ in length"),
        (HEADER.encode() + b"1 2 3\n4 5 6\n", "3 points are declared, 2 are there"),
        (HEADER.encode() + b"1 2 3\n# 2 3\n4 5 6\n", "3 points are declared, 2 are there"),
        (HEADER.encode() + b"1 2 3\n1 2\n4 5 6\n", "line 13 has 2 columns"),
        # pypcd4 would make 200,003 fields.
        (
            _BINARY.replace(b"x y z", b"x y z w")
            .replace(b"4 4 4", b"4 4 4 1")
            .replace(b"F F F", b"F F F U")
            .replace(b"COUNT 1 1 1", b"COUNT 1 1 1 200000")
            + bytes(600_036),
            "200003 values",
        ),
        (_BINARY + bytes(35), "36 bytes are declared, 35 are there"),
        (_COMPRESSED + struct.pack("<II", 40, 36) + bytes(39), "40 bytes are declared, 39 are there"),
        (_COMPRESSED + struct.pack("<II", 4, 4_000_000_000) + bytes(4), "damaged"),
    ],
)
def test_damaged_files_are_read_errors(data: bytes, reason: str) -> None:
    with pytest.raises(CloudReadError, match=reason):
        parse_pcd(data)
