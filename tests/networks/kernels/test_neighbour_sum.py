# SPDX-License-Identifier: Apache-2.0
"""Sums over neighbours and their gradients, against gathered rows."""

from __future__ import annotations

from doorstate.networks.kernels.neighbour_sum import neighbour_sum
from tests.networks import plain
from tests.networks.twins import assert_same, random_indices, rows


def test_neighbour_sum_is_the_sum_of_gathered_rows() -> None:
    indices = random_indices(2, 6, 9, 4)
    indices[0, :, 0] = 3  # point 5 is no neighbour, point 3 one of all points
    indices[indices == 5] = 4
    assert_same(lambda x: neighbour_sum(x, indices), lambda x: plain.gather(x, indices).sum(2), rows(2, 9, 5))
