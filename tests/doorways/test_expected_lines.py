# SPDX-License-Identifier: Apache-2.0
"""Tests of doorstate.doorways.expected_lines."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.doorways.expected_lines import expected_lines, row_density


def test_lines_between_two_rims_change_evenly_and_one_rim_reaches_to_the_outermost_seen_cell() -> None:
    seen = np.zeros((7, 4))
    opening, right, left = np.arange(7) // 2 == 1, np.arange(7) < 2, np.arange(7) > 4
    opening[4] = True
    seen[right], seen[left] = 16.0, 4.0
    in_view, expected = expected_lines(seen, opening, (right, left))
    assert expected[opening][:, 0] == pytest.approx([16, 8, 4])
    assert (in_view == opening[:, None]).all()
    seen[left], seen[3] = 0.0, 1.0
    in_view, expected = expected_lines(seen, opening, (right, left))
    assert (in_view[:, 0] == [0, 0, 1, 1, 0, 0, 0]).all()
    assert (expected[opening] == 16).all()


def test_density_of_rows_equals_a_loop() -> None:
    rim = np.random.default_rng(0).poisson(0.4, (11, 19)).astype(np.float64)
    density = row_density(rim)
    for row in range(19):
        rows = [max(0, row - 1), row, min(18, row + 1)]
        about = [sum(column[rows]) / 3 for column in rim]
        filled = [value for value in about if value > 0]
        assert density[row] == pytest.approx(sum(filled) / len(filled) if len(filled) >= 2 else 0)
