# SPDX-License-Identifier: Apache-2.0
"""Text tables: separators, headers in any order, comments, missing values."""

from __future__ import annotations

import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from numpy.typing import NDArray

from doorstate.errors import CloudReadError
from doorstate.io.text import parse_table
from doorstate.io.text_rows import parse_rows

NAN = np.nan
POINTS = np.array([[1.5, -2.25, 3.125], [NAN, NAN, NAN], [0.5, 0.25, -8.0]])
ROWS = "1.5 -2.25 3.125\nnan nan nan\n0.5 0.25 -8\n"


@pytest.mark.parametrize(
    "text",
    [
        ROWS,
        ROWS.replace(" ", "\t"),
        ROWS.replace(" ", ","),
        ROWS.replace(" ", ", "),
        ROWS.replace(" ", ";"),
        ROWS.replace(" ", "   ").replace("\n", "  \r\n"),
        "\n# a scan, in metres\n\n" + ROWS.replace("\n", " # a note, with commas\n"),
        "\ufeffx,y,z\n" + ROWS.replace(" ", ","),
        '"X";"Y";"Z"\n' + ROWS.replace(" ", ";"),
        "# x y z\n" + ROWS,
        "//X Y Z R\n" + ROWS.replace("\n", " 255\n"),
        "# one row is x y z\n" + ROWS,
        # pandas: an index column, and empty cells for NaN
        ",z,label,x,y\n0,3.125,wall,1.5,-2.25\n1,,,,\n2,-8.0,door,0.5,0.25\n",
        "1.5,-2.25,3.125,wall\n,,,\n0.5,0.25,-8,door\n",
        # columns by name, split as the rows are
        "Time (s),X,Y,Z,Range (m)\n0.01,1.5,-2.25,3.125,4\n0.02,nan,nan,nan,0\n0.03,0.5,0.25,-8,9\n",
        "Time (s) Z [m] Y [m] X [m]\n0 3.125 -2.25 1.5\n0 nan nan nan\n0 -8 0.25 0.5\n",
        "y_m;id;x_m;z_m\n-2.25;a;1.5;3.125\n;b;;\n0.25;c;0.5;-8\n",
        '"Points:0","Points:1","Points:2","range, m"\n' + ROWS.replace(" ", ",").replace("\n", ",1\n"),
        '"x","y","z","label"\n"1.5","-2.25","3.125","wall, left"\n,,,\n"0.5","0.25","-8","door"\n',
        "x,y,z,\n" + ROWS.replace(" ", ",").replace("\n", ",\n"),
        "X,Y,Z\n" + ROWS.replace(" ", ",").replace("\n", ",\n"),
        "# z y x\n3.125 -2.25 1.5 255\nnan nan nan 0\n-8 0.25 0.5 0\n",
        # decimal commas
        ROWS.replace(" ", ";").replace(".", ","),
        ROWS.replace(".", ","),
        ROWS.replace(".", ",").replace(" ", "\t"),
        "".join(
            ",".join(f'"{cell}"' for cell in row.replace(".", ",").split()) + "\n"
            for row in ROWS.splitlines()
        ),
        # the number of points first
        "3\n" + ROWS,
        "# a scan\n3\n" + ROWS.replace("\n", " 12 120 110 100\n"),
        # other line ends and spellings
        ROWS.replace("\n", "\r"),
        ROWS.replace("nan nan nan", "-nan(ind) nan(0x7fc00000) -nan"),
        ROWS.replace("nan nan nan", "1.#QNAN -1.#IND 1.#QNAN00"),
        ROWS.replace(" ", ",").replace("nan,nan,nan", "NA,null,NaN"),
        # numpy.savetxt with header="z,y,x"
        "# z,y,x\n3.125 -2.25 1.5\nnan nan nan\n-8 0.25 0.5\n",
        "# z,y,x\n3.125,-2.25,1.5\nnan,nan,nan\n-8,0.25,0.5\n",
    ],
)
def test_variants(text: str) -> None:
    np.testing.assert_array_equal(parse_table(text.encode("utf-8")), POINTS)


@given(
    npst.arrays(np.float32, st.tuples(st.integers(0, 12), st.integers(3, 6)), elements=st.floats(width=32)),
    st.sampled_from([" ", ",", ";", "\t"]),
    st.sampled_from(["", "x,y,z,a,b,c"]),
)
@settings(max_examples=100)
def test_reads_what_numpy_writes(values: NDArray[np.float32], delimiter: str, header: str) -> None:
    stream = io.BytesIO()
    names = ",".join(header.split(",")[: values.shape[1]])
    np.savetxt(stream, values, fmt="%.9g", delimiter=delimiter, header=names)
    np.testing.assert_array_equal(parse_table(stream.getvalue()).astype(np.float32), values[:, :3])


@pytest.mark.parametrize("text", ["\n", "# nothing\n", "x,y,z\n"])
def test_no_rows_are_no_points(text: str) -> None:
    assert parse_table(text.encode()).shape == (0, 3)


def test_infinity_and_text_in_utf16() -> None:
    assert parse_table(b"1.#INF -1.#INF00 inf").tolist() == [[np.inf, -np.inf, np.inf]]
    np.testing.assert_array_equal(
        parse_table(("x;y;z\r\n" + ROWS.replace(" ", ";")).encode("utf-16")), POINTS
    )
    np.testing.assert_array_equal(parse_table("# 30\N{DEGREE SIGN}\n1 2 3".encode("latin-1")), [[1, 2, 3]])


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("file,state\na.pcd,open\n", "file, state"),
        ("range,angle\n", "range, angle"),
        ("1 2\n3 4\n", "line 1 has 2 columns"),
        ("1 2 3\n\n4 5\n", "line 3 has 2 columns"),
        ("x,y,z\n1,2,wall\n", "line 2, column 3: 'wall'"),
        ("x,y,z\nm,m,m\n1,2,3\n", "line 2"),
        ("1 2 3\n4 5 6_0\n", "line 2, column 3: '6_0'"),
        ("1 2 3\n4 1,234,567 6\n", "'1,234,567'"),
        ("id,x,y,z\n1,2,3\n", "a header of 4 columns, and rows of 3"),
        ('"x" "y" "z"\n"1" 1 2 3\n', "a header of 3 columns, and rows of 4"),
        ("5\n1 2 3\n", "5 points are declared, 1 are there"),
        ("1\n1 2 3\n4 5 6\n", "declares 1 points, and holds 2"),
        ("7\n", "7 points are declared, 0 are there"),
        ("2\n1\n1 2 3\n", "line 2 has 1 column"),
        ("1 2 3\n" + "4" * 70_000, "line 2 has more than 65536 characters"),
        ("1 2 3\n\0", "null bytes"),
    ],
)
def test_other_texts_are_errors_that_say_where(text: str, part: str) -> None:
    with pytest.raises(CloudReadError) as caught:
        parse_table(text.encode())
    assert part in caught.value.message


def test_rows_after_a_header_are_counted_without_blank_lines() -> None:
    body = b"9 9\n\n1 2 3 4\n5 6 7 8\n\n"
    np.testing.assert_array_equal(parse_rows(body, (3, 0, 1), count=2, skip=1), [[4, 1, 2], [8, 5, 6]])
    with pytest.raises(CloudReadError, match="3 points are declared, 2 are there"):
        parse_rows(body, (0, 1, 2), count=3, skip=1)
