# SPDX-License-Identifier: Apache-2.0
"""Row layers: products before grouping, statistics from elsewhere, precision of coordinates."""

from __future__ import annotations

import copy

import pytest
import torch
from torch import Tensor, nn

from doorstate.networks.kernels.ops import gather_rows
from doorstate.networks.kernels.search import ball_query
from doorstate.networks.layers import (
    Dense,
    DenseMax,
    JoinedDense,
    PointLinear,
    PooledMLP,
    RowBatchNorm,
    set_batchnorm,
)
from tests.networks import plain

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


def randomised(module: nn.Module) -> nn.Module:
    """Scales of both signs and running statistics that are not those of an untrained layer."""
    for norm in module.modules():
        if isinstance(norm, RowBatchNorm):
            torch.nn.init.uniform_(norm.weight, -1, 1)
            torch.nn.init.uniform_(norm.bias, -0.5, 0.5)
            torch.nn.init.uniform_(norm.running_mean, -0.5, 0.5)
            torch.nn.init.uniform_(norm.running_var, 0.5, 2)
    for linear in module.modules():
        if isinstance(linear, nn.Linear) and linear.bias is not None:
            torch.nn.init.uniform_(linear.bias, -1, 1)
    return module


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


# Few points take the gradient of all rows, many only that of the rows that have a maximum.
@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("training", [True, False])
@pytest.mark.parametrize("shape", [(2, 6, 8, 5), (3, 256, 5), (2, 300, 5)])
def test_dense_max_equals_its_plain_twin(dtype: torch.dtype, training: bool, shape: tuple[int, ...]) -> None:
    rows = torch.randn(shape, generator=torch.Generator().manual_seed(0)) + 1
    rows[..., -2:, :] = rows[..., :2, :]  # duplicate points
    plain.assert_twins(
        randomised(DenseMax(5, 16)).train(training),
        lambda module, leaves: module(leaves[0]),
        lambda module, leaves: plain.dense(leaves[0], module.linear, module.norm).max(-2).values,
        [rows],
        dtype,
    )


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


def test_coordinates_are_not_rounded_under_autocast() -> None:
    layer = PointLinear(0, 16)
    points = torch.randn(2, 50, 3, generator=torch.Generator().manual_seed(0))
    exact = layer(points)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        assert torch.equal(layer(points), exact.bfloat16())  # rounded once, at the end


def test_set_batchnorm_changes_what_it_is_told_to() -> None:
    network = nn.Sequential(RowBatchNorm(3), nn.Sequential(RowBatchNorm(4)))
    set_batchnorm(network, eps=1e-3)
    assert [(m.eps, m.momentum) for m in (network[0], network[1][0])] == [(1e-3, 0.1)] * 2
    set_batchnorm(network, momentum=0.5)
    assert [(m.eps, m.momentum) for m in (network[0], network[1][0])] == [(1e-3, 0.5)] * 2


def test_joined_layer_equals_a_layer_on_the_concatenation() -> None:
    layer = JoinedDense(4, 6, 5).double()
    rows, features = torch.rand(2, 7, 4, dtype=torch.float64), torch.rand(2, 6, dtype=torch.float64)
    both = torch.cat([rows, features.unsqueeze(1).expand(-1, 7, -1)], dim=-1)
    weight = torch.cat([layer.own.weight, layer.cloud.weight], dim=1)
    expected = torch.nn.functional.batch_norm((both @ weight.T).flatten(0, 1), None, None, training=True)
    torch.testing.assert_close(layer(rows, features), expected.relu().view(2, 7, 5))
