# SPDX-License-Identifier: Apache-2.0
"""NumPy files (.npy, .npz); sizes are checked before allocation, and nothing is unpickled."""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.lib import format as npy_format
from numpy.typing import NDArray

from doorstate.errors import CloudReadError
from doorstate.io.size_limits import check_byte_count, check_size

# Names of the array to read in an archive, in order of preference.
ARRAY_NAMES = ("points", "cloud", "xyz", "depth")


def parse_npy(data: bytes) -> NDArray[Any]:
    """Read the array of a .npy file.

    Returns:
        The array as stored; of a structured array, such as ros_numpy makes, its fields x, y and z as (..., 3).

    Raises:
        CloudReadError: it holds objects, text, complex or 8-bit numbers, or fewer than declared.
    """
    stream = io.BytesIO(data)
    if npy_format.read_magic(stream) == (1, 0):
        shape, _, dtype = npy_format.read_array_header_1_0(stream)
    else:
        shape, _, dtype = npy_format.read_array_header_2_0(stream)
    if not (_is_number(dtype) or _has_axes(dtype)):
        held = f"fields {', '.join(dtype.names)}" if dtype.names else f"{dtype} values"
        raise CloudReadError(f"holds {held}", expected="float32 metres, 16-bit depth, or fields x, y and z")
    check_size(math.prod(shape) * dtype.itemsize, len(data) - stream.tell(), "bytes")
    stream.seek(0)
    stored = np.asarray(npy_format.read_array(stream, allow_pickle=False))
    if dtype.names is None:
        return stored
    return np.stack([stored[axis] for axis in "xyz"], axis=-1)


def _is_number(dtype: np.dtype[Any]) -> bool:
    return dtype.kind in "iuf" and dtype.itemsize > 1


def _has_axes(dtype: np.dtype[Any]) -> bool:
    """Return True if a structured array has one number each for x, y and z, and no objects."""
    fields: Mapping[str, tuple[np.dtype[Any], int] | tuple[np.dtype[Any], int, Any]] = dtype.fields or {}
    return not dtype.hasobject and all(axis in fields and _is_number(fields[axis][0]) for axis in "xyz")


def parse_npz(data: bytes) -> NDArray[Any]:
    """Read the array named points, cloud, xyz or depth of a .npz archive, or its only array.

    Raises:
        CloudReadError: no array has such a name, or it cannot be read.
    """
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
        name = next((name for name in ARRAY_NAMES if name in members), None)
        if name is None and len(members) == 1:
            (name,) = members
        if name is None:
            held = ", ".join(members) or "no arrays"
            raise CloudReadError(f"holds {held}", expected=f"an array named {' or '.join(ARRAY_NAMES)}")
        check_byte_count(members[name].file_size)
        return parse_npy(archive.read(members[name]))
