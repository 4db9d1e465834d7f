# SPDX-License-Identifier: Apache-2.0
"""Memory settings of the process."""

from __future__ import annotations

import ctypes
import sys

_M_TRIM_THRESHOLD, _M_MMAP_MAX = -1, -4  # malloc.h of glibc


def keep_freed_memory() -> None:
    """Keep freed memory in the process instead of returning it after every tensor, with glibc.

    glibc maps each large block again and the kernel fills it with zeros, which takes as long as the arithmetic on it.
    Without that, a training step of PointNet++ is more than twice as fast (paper/log.md).
    """
    if not sys.platform.startswith("linux"):
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_MMAP_MAX, 0)
        mallopt(_M_TRIM_THRESHOLD, 2**31 - 1)
