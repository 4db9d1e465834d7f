# SPDX-License-Identifier: Apache-2.0
"""Shares of the cells of an opening that end on the wall, pass it, are hidden or are missing.

Where points are few, cells are taken together, so that an empty one is a hole and not chance.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.doorways.expected_lines import MIN_LINES, Cells

_POOLS = (1, 2, 3)  # cells that are taken together, in both directions, where points are few
_MIN_FILLED = 0.9  # of the cells of each rim: seen along the wall, whole columns lie between two sight lines


class CellShares(NamedTuple):
    """Shares of the cells in view, which sum to 1; all are 0 if none is in view."""

    on_wall: float
    through: float
    hidden: float
    missing: float


def cell_shares(
    lines: Cells, expected: Cells, in_view: Cells, rims: Sequence[NDArray[np.bool_]]
) -> tuple[CellShares, NDArray[np.bool_]]:
    """Return the shares of an opening, and its missing cells (columns, rows).

    Args:
        lines: (3, columns, rows) sight lines that end on the wall, behind and before it.
        expected: (columns, rows) sight lines expected in each cell.
        in_view: (columns, rows) above 0 for the cells of the opening that are in view.
        rims: columns beside the opening.
    """
    if in_view.sum() == 0:
        return CellShares(0.0, 0.0, 0.0, 0.0), np.zeros(in_view.shape, dtype=bool)
    seen = lines.sum(axis=0)
    beside = [seen[rim][:, in_view.any(axis=0)] for rim in rims]
    for pool in _POOLS:
        pooled_expected, cells = pooled(np.stack([expected * in_view, in_view]), pool)
        is_in_view = cells >= 0.5 * pool**2
        counted = is_in_view & (pooled_expected >= MIN_LINES)
        is_enough = counted.any() and np.count_nonzero(counted) >= 0.5 * np.count_nonzero(is_in_view)
        if is_enough and all(_filled_share(rim, pool) >= _MIN_FILLED for rim in beside):
            break
    else:
        counted = cells > 0  # too few points to tell a hole from chance in each cell
    counts = pooled(lines * in_view, pool)
    totals = counts.sum(axis=0)
    empty = counted & (totals == 0)
    filled = counted & (totals > 0)
    weights = cells / cells[counted].sum()
    parts = [float((part / np.maximum(totals, 1) * weights)[filled].sum()) for part in counts]
    wide = empty.repeat(pool, axis=0).repeat(pool, axis=1)[: seen.shape[0], : seen.shape[1]]
    is_missing = wide & (in_view > 0) & (seen == 0)
    return CellShares(parts[0], parts[1], parts[2], float(weights[empty].sum())), is_missing


def pooled(cells: Cells, pool: int) -> Cells:
    """Return the sums of blocks of `pool` x `pool` cells (..., columns, rows)."""
    if pool == 1:
        return cells
    columns, rows = (-(-size // pool) for size in cells.shape[-2:])
    sums = np.zeros((*cells.shape[:-2], columns, rows))
    for i, j in product(range(pool), repeat=2):
        part = cells[..., i::pool, j::pool]
        sums[..., : part.shape[-2], : part.shape[-1]] += part
    return sums


def _filled_share(seen: Cells, pool: int) -> float:
    """Return the share of the pooled cells of a rim that were measured; 1 where none were, as out of view."""
    filled = pooled(seen, pool) > 0
    return float(filled.mean()) if filled.any() else 1.0
