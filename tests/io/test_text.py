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
from doorstate.io.text import parse_rows, parse_table

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
        # numpy.savetxt with header="z,y,x"
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
@settings(deadline=None, max_examples=100)
def test_reads_what_numpy_writes(values: NDArray[np.float32], delimiter: str, header: str) -> None:
    stream = io.BytesIO()
    names = ",".join(header.split(",")[: values.shape[1]])
    np.savetxt(stream, values, fmt="%.9g", delimiter=delimiter, header=names)
    np.testing.assert_array_equal(parse_table(stream.getvalue()).astype(np.float32), values[:, :3])


@pytest.mark.parametrize("text", ["\n", "# nothing\n", "x,y,z\n"])
def test_no_rows_are_no_points(text: str) -> None:
    assert parse_table(text.encode()).shape == (0, 3)


@pytest.mark.parametrize(
    "text", ["file,state\na.pcd,open\n", "1 2\n3 4\n", "1 2 3\n4 5\n", "x,y,z\n1,2,wall\n"]
)
def test_other_texts_are_errors(text: str) -> None:
    with pytest.raises(CloudReadError, match="rows of numbers, or a header naming x, y, z"):
        parse_table(text.encode())


def test_a_header_of_more_columns_than_the_rows_is_not_guessed() -> None:
    with pytest.raises(CloudReadError):
        parse_table(b"id,x,y,z\n1,2,3\n")


def test_rows_after_a_header_are_counted_without_blank_lines() -> None:
    body = b"9 9\n\n1 2 3 4\n5 6 7 8\n\n"
    np.testing.assert_array_equal(parse_rows(body, (3, 0, 1), count=2, skip=1), [[4, 1, 2], [8, 5, 6]])
    with pytest.raises(CloudReadError, match="3 points are declared, 2 are there"):
        parse_rows(body, (0, 1, 2), count=3, skip=1)
