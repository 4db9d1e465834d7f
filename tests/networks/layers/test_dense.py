# SPDX-License-Identifier: Apache-2.0
"""Dense layers against plain twins."""

from __future__ import annotations

import pytest
import torch

from doorstate.networks.layers.dense import Dense, JoinedDense
from tests.networks import plain
from tests.networks.layers.randomised import randomised

DTYPES = [torch.float64, torch.float32]


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("training", [True, False])
def test_dense_equals_its_plain_twin(dtype: torch.dtype, training: bool) -> None:
    rows = torch.randn(3, 7, 5, generator=torch.Generator().manual_seed(0)) + 1
    plain.assert_twins(
        randomised(Dense(5, 8)).train(training),
        lambda module, leaves: module(leaves[0]),
        lambda module, leaves: plain.dense(leaves[0], module[0], module[1]),
        [rows],
        dtype,
    )


def test_joined_layer_equals_a_layer_on_the_concatenation() -> None:
    layer = JoinedDense(4, 6, 5).double()
    rows, features = torch.rand(2, 7, 4, dtype=torch.float64), torch.rand(2, 6, dtype=torch.float64)
    both = torch.cat([rows, features.unsqueeze(1).expand(-1, 7, -1)], dim=-1)
    weight = torch.cat([layer.own.weight, layer.cloud.weight], dim=1)
    expected = torch.nn.functional.batch_norm((both @ weight.T).flatten(0, 1), None, None, training=True)
    torch.testing.assert_close(layer(rows, features), expected.relu().view(2, 7, 5))
