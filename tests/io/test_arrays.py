# SPDX-License-Identifier: Apache-2.0
"""NumPy files: round trips, archives of several arrays, false headers."""

from __future__ import annotations

import io
import zipfile
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from numpy.typing import NDArray

from doorstate.errors import CloudReadError
from doorstate.io.arrays import parse_npy, parse_npz

POINTS = np.arange(12, dtype=np.float32).reshape(4, 3)


def _npy(array: NDArray[Any], version: tuple[int, int] | None = None) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, array, version=version)
    return stream.getvalue()


def _npz(**arrays: NDArray[Any]) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, allow_pickle=False, **arrays)
    return stream.getvalue()


_numbers = st.sampled_from(["<f2", "<f4", ">f4", "<f8", "<u2", ">u2", "<i4", "<u8"])


@given(npst.arrays(_numbers, npst.array_shapes(min_dims=1, max_dims=3, min_side=0)), st.booleans())
@settings(max_examples=50)
def test_round_trip(array: NDArray[Any], fortran: bool) -> None:
    stored = np.asfortranarray(array) if fortran else array
    for data in (_npy(stored), _npy(stored, (2, 0)), _npy(stored, (3, 0))):
        np.testing.assert_array_equal(parse_npy(data), array)
        assert parse_npy(data).dtype == array.dtype
    np.testing.assert_array_equal(parse_npz(_npz(anything=stored)), array)


@pytest.mark.parametrize("name", ["points", "cloud", "xyz", "depth"])
def test_a_named_array_is_read_among_others(name: str) -> None:
    np.testing.assert_array_equal(parse_npz(_npz(a=np.zeros(3), b=np.zeros(2), **{name: POINTS})), POINTS)


def test_points_are_preferred_to_depth() -> None:
    np.testing.assert_array_equal(parse_npz(_npz(depth=np.zeros((4, 40)), points=POINTS)), POINTS)


def test_an_undecided_archive_lists_its_arrays() -> None:
    with pytest.raises(CloudReadError, match="left, right"):
        parse_npz(_npz(left=POINTS, right=POINTS))
    with pytest.raises(CloudReadError, match="no arrays"):
        parse_npz(_npz())


@pytest.mark.parametrize(
    "array",
    [
        POINTS.astype(complex),
        POINTS.astype(str),
        POINTS.astype(bool),
        POINTS.astype(np.uint8),
        np.zeros(4, "M8[s]"),
        np.zeros(4, [("x", "f4"), ("y", "f4"), ("intensity", "f4")]),
        np.zeros(4, [("x", "f4"), ("y", "f4"), ("z", "u1")]),
    ],
    ids=lambda array: str(array.dtype),
)
def test_other_kinds_of_values_are_refused(array: NDArray[Any]) -> None:
    with pytest.raises(CloudReadError, match=r"holds (.* values|fields x, y, .*)"):
        parse_npy(_npy(array))


@given(npst.arrays(np.float32, npst.array_shapes(max_dims=2).map(lambda shape: (*shape, 3))), st.booleans())
@settings(max_examples=30)
def test_structured_arrays_have_fields_x_y_z(points: NDArray[np.float32], is_big_endian: bool) -> None:
    kind = ">f4" if is_big_endian else "<f4"
    stored = np.zeros(points.shape[:-1], [("intensity", "u1"), ("z", kind), ("x", kind), ("y", "<f8")])
    for axis, name in enumerate("xyz"):
        stored[name] = points[..., axis]
    for read in (parse_npy(_npy(stored)), parse_npz(_npz(cloud=stored))):
        np.testing.assert_array_equal(read.astype(np.float32), points)


class _Trap:
    def __reduce__(self) -> tuple[Any, ...]:
        return pytest.fail, ("a pickle was opened",)


def test_objects_are_never_unpickled() -> None:
    stream = io.BytesIO()
    np.save(stream, np.array([_Trap()], dtype=object), allow_pickle=True)
    with pytest.raises(CloudReadError, match="object values"):
        parse_npy(stream.getvalue())


def test_false_declared_sizes_are_refused() -> None:
    with pytest.raises(CloudReadError, match="48 bytes are declared, 47 are there"):
        parse_npy(_npy(POINTS)[:-1])
    with pytest.raises(CloudReadError, match="-48 bytes are declared"):
        parse_npy(_npy(POINTS).replace(b"(4, 3), ", b"(-4, 3),"))


def test_a_member_that_unpacks_to_gigabytes_is_not_unpacked() -> None:
    stream = io.BytesIO(_npz(points=POINTS))
    with zipfile.ZipFile(stream, "a") as archive:
        archive.getinfo("points.npy").file_size = 3 << 30
        archive.writestr("note.txt", "forces a new directory")
    with pytest.raises(CloudReadError, match="3221225472 bytes"):
        parse_npz(stream.getvalue())
