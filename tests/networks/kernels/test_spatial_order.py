# SPDX-License-Identifier: Apache-2.0
"""Order of points in which runs of points lie together."""

from __future__ import annotations

import pytest
import torch

from doorstate.networks.kernels.gather import gather_rows
from doorstate.networks.kernels.spatial_order import spatial_order
from tests.networks.twins import random_rows


def test_spatial_order_is_a_permutation_of_near_runs() -> None:
    points = random_rows(2, 1024, 3)
    order = spatial_order(points)
    assert torch.equal(order.sort(1).values, torch.arange(1024).expand(2, -1))
    runs = gather_rows(points, order).view(2, 32, 32, 3)
    assert runs.var(2).sum(-1).mean() < 0.3 * points.var(1).sum(-1).mean()


@pytest.mark.parametrize("count", [1, 7, 96, 100, 1000])
def test_spatial_order_of_any_number_of_points(count: int) -> None:
    order = spatial_order(random_rows(1, count, 3))
    assert torch.equal(order.sort(1).values, torch.arange(count).view(1, -1))
