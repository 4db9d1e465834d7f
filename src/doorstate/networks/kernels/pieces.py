# SPDX-License-Identifier: Apache-2.0
"""Work in pieces that stay in a core's cache."""

from __future__ import annotations

from collections.abc import Iterator

VALUES_PER_PIECE = 2**19  # 2 MiB of float32


def pieces(count: int, values_each: int) -> Iterator[slice]:
    """Yield slices of `count` items, `values_each` numbers per item, that each fit the cache."""
    size = max(1, VALUES_PER_PIECE // values_each)
    return (slice(start, min(start + size, count)) for start in range(0, count, size))
