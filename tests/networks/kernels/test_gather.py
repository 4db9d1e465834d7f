# SPDX-License-Identifier: Apache-2.0
"""Rows of a batch of clouds by index."""

from __future__ import annotations

from doorstate.networks.kernels.gather import gather_rows
from tests.networks import plain
from tests.networks.twins import assert_same, random_indices, rows


def test_gather_rows_picks_rows_of_the_same_cloud() -> None:
    indices = random_indices(3, 5, 7, 2)
    assert_same(lambda x: gather_rows(x, indices), lambda x: plain.gather(x, indices), rows(3, 7, 4))
