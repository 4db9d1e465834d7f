# SPDX-License-Identifier: Apache-2.0
"""NumPy files (.npy, .npz); sizes are checked before allocation, and nothing is unpickled."""

from __future__ import annotations

import io
import math
import zipfile
from typing import Any

import numpy as np
from numpy.lib import format as npy_format
from numpy.typing import NDArray

from doorstate.errors import CloudReadError
from doorstate.io.size_limits import MAX_FILE_BYTES, check_size

# Names of the array to read in an archive, in order of preference.
ARRAY_NAMES = ("points", "cloud", "xyz", "depth")


def parse_npy(data: bytes) -> NDArray[Any]:
    """Read the array of a .npy file.

    Raises:
        CloudReadError: it holds objects, text, complex or 8-bit numbers, or fewer than declared.
    """
    stream = io.BytesIO(data)
    if npy_format.read_magic(stream) == (1, 0):
        shape, _, dtype = npy_format.read_array_header_1_0(stream)
    else:
        shape, _, dtype = npy_format.read_array_header_2_0(stream)
    if dtype.kind not in "iuf" or dtype.itemsize == 1:
        raise CloudReadError(f"holds {dtype} values", expected="float32 metres, or 16-bit depth")
    check_size(math.prod(shape) * dtype.itemsize, len(data) - stream.tell(), "bytes")
    stream.seek(0)
    return np.asarray(npy_format.read_array(stream, allow_pickle=False))


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
        if members[name].file_size > MAX_FILE_BYTES:
            raise CloudReadError(
                f"array {name} unpacks to {members[name].file_size} bytes: not one camera frame"
            )
        return parse_npy(archive.read(members[name]))
