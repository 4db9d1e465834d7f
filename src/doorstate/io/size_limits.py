# SPDX-License-Identifier: Apache-2.0
"""Limits of clouds and of the files that hold them, checked before anything of that size is read or allocated."""

from __future__ import annotations

from doorstate.errors import CloudReadError

# The largest depth cameras have 8 megapixels. A small file can unpack to far more.
MAX_POINTS = 1 << 23
# Four float64 for every point, or 32 characters; files of ordinary cameras hold a hundredth.
MAX_FILE_BYTES = 32 * MAX_POINTS


def check_size(declared: int, present: int, unit: str) -> None:
    """Check that a declared number is not negative and not more than is present.

    Raises:
        CloudReadError: it is.
    """
    if declared < 0:
        raise CloudReadError(f"is damaged: {declared} {unit} are declared")
    if declared > present:
        raise CloudReadError(f"is truncated: {declared} {unit} are declared, {present} are there")


def check_point_count(count: int) -> None:
    """Check that a depth camera can have this number of points or pixels.

    Raises:
        CloudReadError: there are more.
    """
    if count > MAX_POINTS:
        raise CloudReadError(f"holds {count} points: not one camera frame", expected=f"at most {MAX_POINTS}")


def check_byte_count(count: int) -> None:
    """Check that one camera frame can have this number of bytes.

    Raises:
        CloudReadError: there are more.
    """
    if count > MAX_FILE_BYTES:
        raise CloudReadError(
            f"holds {count} bytes: not one camera frame", expected=f"at most {MAX_FILE_BYTES}"
        )
