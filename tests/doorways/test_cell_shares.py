# SPDX-License-Identifier: Apache-2.0
"""Tests of doorstate.doorways.cell_shares."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.doorways.cell_shares import cell_shares, pooled


def test_shares_are_those_of_the_cells_that_are_counted() -> None:
    lines = np.full((3, 8, 2), 4.0)
    lines[:, 3, 0] = 0
    in_view, expected = np.zeros((8, 2)), np.full((8, 2), 12.0)
    in_view[2:6] = 1
    rims = (np.arange(8) < 2, np.arange(8) > 5)
    shares, is_missing = cell_shares(lines, expected, in_view, rims)
    assert shares == pytest.approx((7 / 24, 7 / 24, 7 / 24, 1 / 8))
    assert np.argwhere(is_missing).tolist() == [[3, 0]]
    assert cell_shares(lines, expected, 0 * in_view, rims)[0] == (0, 0, 0, 0)


@pytest.mark.parametrize("pool", [1, 2, 3])
def test_pooled_cells_equal_sums_of_padded_blocks(pool: int) -> None:
    for shape in ((1, 1), (7, 5), (9, 6), (8, 19)):
        cells = np.random.default_rng(0).integers(0, 9, shape).astype(np.float64)
        columns, rows = (-(-size // pool) for size in shape)
        padded = np.pad(cells, ((0, columns * pool - shape[0]), (0, rows * pool - shape[1])))
        plain = padded.reshape(columns, pool, rows, pool).sum(axis=(1, 3))
        assert (pooled(cells, pool) == plain).all()
        assert (pooled(np.stack([cells, 2 * cells]), pool) == np.stack([plain, 2 * plain])).all()
