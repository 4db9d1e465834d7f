# SPDX-License-Identifier: Apache-2.0
"""Sight lines expected in the cells of an opening, from those of the wall on both sides."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Cells = NDArray[np.float64]

MIN_LINES = 6.0  # expected in a cell or place: one in 400 such places is empty by chance


def expected_lines(
    seen: Cells, opening: NDArray[np.bool_], rims: Sequence[NDArray[np.bool_]]
) -> tuple[Cells, Cells]:
    """Return the cells (columns, rows) of the opening that are in view, and the sight lines expected in each.

    Sight lines through a plane get fewer smoothly with its range, whatever they end on, so that those of the rims tell
    how many to expect between them. With one rim in view, cells count up to the outermost that was seen.
    """
    right, left = (row_density(seen[rim]) for rim in rims)
    share = np.linspace(0, 1, int(opening.sum()))[:, None]  # from the right rim to the left one
    has_both = (right > 0) & (left > 0)
    larger = np.maximum(right, left)
    least = 1e-9  # of a power
    between = np.maximum(right, least) ** (1 - share) * np.maximum(left, least) ** share
    filled = seen[opening] > 0
    from_right = np.cumsum(filled[::-1], axis=0)[::-1] > 0  # up to the outermost seen cell
    from_left = np.cumsum(filled, axis=0) > 0
    up_to = np.where(right > 0, from_right, from_left) & (larger > 0)
    expected = np.where(has_both, between, np.broadcast_to(larger, between.shape))
    shape = seen.shape
    in_view, all_expected = np.zeros(shape, dtype=bool), np.zeros(shape)
    in_view[opening] = has_both | up_to
    all_expected[opening] = expected
    return in_view.astype(np.float64), all_expected


def row_density(rim: Cells) -> Cells:
    """Return the mean number of sight lines (rows) of the cells of a rim that were measured; 0 where too few were."""
    if len(rim) == 0:
        return np.zeros(rim.shape[1])
    padded = np.concatenate([rim[:, :1], rim, rim[:, -1:]], axis=1)
    about = (padded[:, :-2] + padded[:, 1:-1] + padded[:, 2:]) / 3
    filled = np.count_nonzero(about, axis=0)
    density: Cells = np.where(filled >= 2, about.sum(axis=0) / np.maximum(filled, 1), 0)
    return density
