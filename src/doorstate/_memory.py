# SPDX-License-Identifier: Apache-2.0
"""Memory settings of the process."""

from __future__ import annotations

import ctypes
import sys

_M_TRIM_THRESHOLD, _M_MMAP_MAX = -1, -4  # malloc.h of glibc


def keep_freed_memory() -> None:
    """Let this process reuse freed memory instead of giving it back after every tensor, where the C library is glibc.

    glibc maps every large block anew and the kernel fills it with zeros, which takes as long as the arithmetic on it:
    a training step of PointNet++ is more than twice as quick without (paper/log.md).
    """
    if not sys.platform.startswith("linux"):
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_MMAP_MAX, 0)
        mallopt(_M_TRIM_THRESHOLD, 2**31 - 1)
