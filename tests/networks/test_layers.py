# SPDX-License-Identifier: Apache-2.0
"""Row layers: products before grouping, statistics from elsewhere, precision of coordinates."""

from __future__ import annotations

import copy

import plain
import pytest
import torch
from torch import Tensor, nn

from doorstate.networks.layers import DenseMax, PointLinear, PooledMLP, RowBatchNorm, set_batchnorm
from doorstate.networks.ops import ball_query, gather_rows

DTYPES = [torch.float64, torch.float32]


@pytest.fixture
def grouped() -> tuple[Tensor, Tensor, Tensor]:
    """(B, N, 3) points, (B, N, F) features, (B, M, K) neighbours of the first M points."""
    points = torch.randn(2, 30, 3, generator=torch.Generator().manual_seed(0))
    features = torch.randn(2, 30, 5, generator=torch.Generator().manual_seed(1))
    return points, features, ball_query(points[:, :6], points, 1.0, 8)


@pytest.mark.parametrize("dtype", DTYPES)
def test_product_before_grouping_equals_product_of_every_neighbour(
    dtype: torch.dtype, grouped: tuple[Tensor, Tensor, Tensor]
) -> None:
    points, features, indices = grouped

    def fast(module: nn.Module, leaves: list[Tensor]) -> Tensor:
        offsets = gather_rows(leaves[0], indices) - leaves[0][:, :6].unsqueeze(2)
        return module(offsets, leaves[1], indices)

    def literal(module: nn.Module, leaves: list[Tensor]) -> Tensor:
        offsets = plain.gather(leaves[0], indices) - leaves[0][:, :6].unsqueeze(2)
        rows = torch.cat([offsets, plain.gather(leaves[1], indices)], dim=-1)
        return nn.functional.linear(rows, module.weight, module.bias)

    plain.assert_twins(PointLinear(5, 7), fast, literal, [points, features], dtype)


@pytest.mark.parametrize("dtype", DTYPES)
def test_pooled_mlp_equals_its_plain_twin(dtype: torch.dtype, grouped: tuple[Tensor, Tensor, Tensor]) -> None:
    points, features, indices = grouped

    def fast(module: nn.Module, leaves: list[Tensor]) -> Tensor:
        offsets = gather_rows(leaves[0], indices) - leaves[0][:, :6].unsqueeze(2)
        return module(offsets, leaves[1], indices)

    def literal(module: nn.Module, leaves: list[Tensor]) -> Tensor:
        offsets = plain.gather(leaves[0], indices) - leaves[0][:, :6].unsqueeze(2)
        return plain.pooled_mlp(torch.cat([offsets, plain.gather(leaves[1], indices)], dim=-1), module)

    plain.assert_twins(PooledMLP(5, (8, 9, 10)), fast, literal, [points, features], dtype)


def test_relu_after_the_maximum_is_relu_before_it() -> None:
    rows = torch.randn(3, 4, 6, 5, generator=torch.Generator().manual_seed(0))
    module = DenseMax(5, 7)
    twin = copy.deepcopy(module)
    expected = torch.relu(twin.norm(twin.linear(rows))).amax(-2)
    torch.testing.assert_close(module(rows), expected)


def test_coordinates_are_not_rounded_under_autocast() -> None:
    layer = PointLinear(0, 16)
    points = torch.randn(2, 50, 3, generator=torch.Generator().manual_seed(0))
    exact = layer(points)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        assert torch.equal(layer(points), exact)


def test_normalize_is_batch_norm_with_statistics_from_elsewhere() -> None:
    rows = torch.randn(4, 25, 6, generator=torch.Generator().manual_seed(0), dtype=torch.float64) * 3 + 1
    norm, twin = RowBatchNorm(6).double(), RowBatchNorm(6).double()
    flat = rows.flatten(0, 1)
    out = norm.normalize(rows, flat.mean(0), flat.var(0, correction=0), count=100)
    torch.testing.assert_close(out, twin(rows), rtol=0, atol=1e-12)
    for name, expected in twin.state_dict().items():
        torch.testing.assert_close(norm.state_dict()[name], expected)


def test_set_batchnorm_changes_what_it_is_told_to() -> None:
    network = nn.Sequential(RowBatchNorm(3), nn.Sequential(RowBatchNorm(4)))
    set_batchnorm(network, eps=1e-3)
    assert [(m.eps, m.momentum) for m in (network[0], network[1][0])] == [(1e-3, 0.1)] * 2
    set_batchnorm(network, momentum=0.5)
    assert [(m.eps, m.momentum) for m in (network[0], network[1][0])] == [(1e-3, 0.5)] * 2
