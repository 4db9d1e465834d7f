# SPDX-License-Identifier: Apache-2.0
"""Small PointNets: products before grouping, maxima, precision of coordinates."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor, nn

from doorstate.networks.kernels.ball_query import ball_query
from doorstate.networks.kernels.gather import gather_rows
from doorstate.networks.layers.point_mlp import DenseMax, PointLinear, PooledMLP
from tests.networks import plain
from tests.networks.layers.randomised import randomised

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


def test_coordinates_are_not_rounded_under_autocast() -> None:
    layer = PointLinear(0, 16)
    points = torch.randn(2, 50, 3, generator=torch.Generator().manual_seed(0))
    exact = layer(points)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        assert torch.equal(layer(points), exact.bfloat16())  # rounded once, at the end
