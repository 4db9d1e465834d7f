# SPDX-License-Identifier: Apache-2.0
"""Work in pieces that stay in a core's cache, and the choice between forms for CPUs and for other devices."""

from __future__ import annotations

from collections.abc import Iterator

from torch import Tensor

VALUES_PER_PIECE = 2**19  # 2 MiB of float32
_VALUES_ON_DEVICE = 2**26  # 256 MiB of float32: no piece stays in a cache there, and each costs a launch


def on_cpu(tensor: Tensor) -> bool:
    """Return True where the forms for caches and few threads are the quick ones.

    On any other device the plain forms run, whose shapes do not depend on values: nothing waits for the device.
    """
    return tensor.device.type == "cpu"


def pieces(count: int, values_each: int, like: Tensor) -> Iterator[slice]:
    """Yield slices of `count` items, `values_each` numbers per item, that each fit the cache.

    On another device than the CPU they fit its memory.

    Args:
        count: number of items.
        values_each: numbers that the work on one item makes.
        like: tensor on the device of the work.
    """
    size = max(1, (VALUES_PER_PIECE if on_cpu(like) else _VALUES_ON_DEVICE) // values_each)
    return (slice(start, min(start + size, count)) for start in range(0, count, size))
