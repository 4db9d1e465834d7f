# SPDX-License-Identifier: Apache-2.0
"""Batch normalisation of rows: statistics without outputs, settings of a whole network."""

from __future__ import annotations

import copy

import pytest
import torch
from torch import nn

from doorstate.networks.layers.batch_norm import RowBatchNorm, set_batchnorm
from doorstate.networks.layers.dense import Dense
from doorstate.networks.layers.point_mlp import DenseMax
from tests.networks.layers.randomised import randomised


@pytest.mark.parametrize("make", [Dense, DenseMax])
@pytest.mark.parametrize("count", [40, 300])
def test_running_statistics_are_those_of_batch_norm(make: type[nn.Module], count: int) -> None:
    rows = torch.randn(2, count, 5, generator=torch.Generator().manual_seed(0)).double() * 3 + 1
    module = randomised(make(5, 8)).double()
    linear, norm = list(module.children())[:2]
    twin = copy.deepcopy(norm)
    for _ in range(2):
        twin(linear(rows))
        module(rows)
    for name, expected in twin.state_dict().items():
        torch.testing.assert_close(norm.state_dict()[name], expected, rtol=1e-12, atol=1e-12)


def test_set_batchnorm_changes_the_given_settings_only() -> None:
    network = nn.Sequential(RowBatchNorm(3), nn.Sequential(RowBatchNorm(4)))
    set_batchnorm(network, eps=1e-3)
    assert [(m.eps, m.momentum) for m in (network[0], network[1][0])] == [(1e-3, 0.1)] * 2
    set_batchnorm(network, momentum=0.5)
    assert [(m.eps, m.momentum) for m in (network[0], network[1][0])] == [(1e-3, 0.5)] * 2
