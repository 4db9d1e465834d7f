# SPDX-License-Identifier: Apache-2.0
"""Maxima over neighbours and their gradients, against gathered rows."""

from __future__ import annotations

import pytest
import torch

from doorstate.networks.kernels.neighbour_max import neighbour_max
from tests.networks import plain
from tests.networks.twins import assert_same, random_indices, rows


@pytest.mark.parametrize("ties", [False, True])
def test_neighbour_max_is_the_maximum_of_gathered_rows(ties: bool) -> None:
    indices = random_indices(2, 6, 9, 4)
    values = rows(2, 9, 5)
    if ties:  # the first of equal neighbours gets the gradient, as in torch.max
        values = values.round()
    assert_same(lambda x: neighbour_max(x, indices), lambda x: plain.gather(x, indices).max(2).values, values)
    assert torch.equal(neighbour_max(values, indices), plain.gather(values, indices).amax(2))
