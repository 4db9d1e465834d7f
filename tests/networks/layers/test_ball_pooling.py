# SPDX-License-Identifier: Apache-2.0
"""PointNet on balls without repeated points, against all slots written out."""

from __future__ import annotations

import pytest
import torch

from doorstate.networks.kernels.ball_query import ball_query
from doorstate.networks.layers.ball_pooling import pool_balls
from doorstate.networks.layers.point_mlp import PooledMLP
from tests.networks import plain
from tests.networks.layers.randomised import randomised
from tests.networks.twins import random_rows


@pytest.mark.parametrize("num_features", [0, 5])
@pytest.mark.parametrize("radius", [0.01, 0.8, 9.0])  # balls of one point, of some, full ones
@pytest.mark.parametrize("slots", [5, 12, 32])  # in runs of 1, 4 and 8
def test_pooled_balls_equal_their_plain_twin(num_features: int, radius: float, slots: int) -> None:
    points = random_rows(2, 40, 3, seed=1).double()
    features = random_rows(2, 40, 5, seed=2).double() if num_features else None
    module = randomised(PooledMLP(num_features, (6, 7, 8))).double().eval()
    centres = points[:, :10]
    indices = ball_query(centres, points, radius, slots)
    rows = plain.gather(points, indices) - centres.unsqueeze(2)
    if features is not None:
        rows = torch.cat([rows, plain.gather(features, indices)], dim=-1)
    pooled = pool_balls(module, points, centres, features, indices)
    torch.testing.assert_close(pooled, plain.pooled_mlp(rows, module), rtol=1e-9, atol=1e-9)
