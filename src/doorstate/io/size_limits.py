# SPDX-License-Identifier: Apache-2.0
"""A header may declare no more than its file holds: checked before anything of that size is allocated."""

from __future__ import annotations

from doorstate.errors import CloudReadError

# The largest depth cameras have 8 megapixels. A file may pack far more into a few bytes.
MAX_POINTS = 1 << 23


def check_size(declared: int, present: int, unit: str) -> None:
    """Raise CloudReadError when a negative number of units is declared, or more than is present."""
    if declared < 0:
        raise CloudReadError(f"is damaged: {declared} {unit} are declared")
    if declared > present:
        raise CloudReadError(f"is truncated: {declared} {unit} are declared, {present} are there")


def check_point_count(count: int) -> None:
    """Raise CloudReadError when there are more points or pixels than a depth camera has."""
    if count > MAX_POINTS:
        raise CloudReadError(f"holds {count} points: not one camera frame (at most {MAX_POINTS})")
