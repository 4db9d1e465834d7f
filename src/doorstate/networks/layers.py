# SPDX-License-Identifier: Apache-2.0
"""Layers on rows: every tensor is (B, ..., C), channels last, and a point is a row."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn import functional

from doorstate.networks.ops import full_precision, gather_rows, max_over


class RowBatchNorm(nn.BatchNorm1d):
    """Batch normalisation of channels over all rows of all clouds."""

    momentum: float
    running_mean: Tensor
    running_var: Tensor
    num_batches_tracked: Tensor

    def forward(self, rows: Tensor) -> Tensor:
        return super().forward(rows.reshape(-1, self.num_features)).view(rows.shape)

    def normalize(self, rows: Tensor, mean: Tensor, variance: Tensor, count: int) -> Tensor:
        """Normalise with batch statistics found elsewhere, and let the running statistics follow them.

        Args:
            rows: (B, ..., C).
            mean: (C,) of the batch.
            variance: (C,) of the batch, divided by count.
            count: number of rows the statistics are of.
        """
        with torch.no_grad():
            self.num_batches_tracked += 1
            self.running_mean.lerp_(mean, self.momentum)
            self.running_var.lerp_(variance * (count / (count - 1)), self.momentum)
        scale = self.weight * torch.rsqrt(variance + self.eps)
        return (rows - mean) * scale + self.bias


def set_batchnorm(network: nn.Module, eps: float | None = None, momentum: float | None = None) -> None:
    """Change epsilon or momentum of every batch normalisation in a network.

    Args:
        network: any module.
        eps: added to the variance; the TensorFlow originals use 1e-3.
        momentum: weight of the newest batch in the running statistics, 1 - (TensorFlow's decay).
    """
    for module in network.modules():
        if isinstance(module, nn.BatchNorm1d):
            module.eps = module.eps if eps is None else eps
            module.momentum = module.momentum if momentum is None else momentum


def glorot(layer: nn.Linear) -> nn.Linear:
    """Give a linear layer Glorot-uniform weights and a zero bias, as the TensorFlow originals have."""
    nn.init.xavier_uniform_(layer.weight)
    if layer.bias is not None:
        nn.init.zeros_(layer.bias)
    return layer


def dense(in_channels: int, out_channels: int) -> nn.Sequential:
    """Linear, batch normalisation, ReLU; the bias is kept, as in the originals."""
    linear = glorot(nn.Linear(in_channels, out_channels))
    return nn.Sequential(linear, RowBatchNorm(out_channels), nn.ReLU())


def classification_head(in_channels: int, num_classes: int, dropout: float) -> nn.Sequential:
    """Two dense layers of 512 and 256 with dropout, then logits."""
    return nn.Sequential(
        dense(in_channels, 512),
        nn.Dropout(dropout),
        dense(512, 256),
        nn.Dropout(dropout),
        glorot(nn.Linear(256, num_classes)),
    )


class PointLinear(nn.Linear):
    """Linear layer on [coordinates; features], whose coordinate part ignores autocast.

    W [x_j - c; f_j] = W_x (x_j - c) + W_f f_j: the feature product is taken once per point, before grouping.
    """

    def __init__(self, num_features: int, out_channels: int, bias: bool = True) -> None:
        super().__init__(3 + num_features, out_channels, bias)
        glorot(self)

    def forward(
        self, offsets: Tensor, features: Tensor | None = None, indices: Tensor | None = None
    ) -> Tensor:
        """Apply the layer, optionally to neighbourhoods.

        Args:
            offsets: (B, ..., 3) coordinates, or coordinates relative to a centre.
            features: (B, N, C) features of the points, if the layer has any.
            indices: (B, ...) the point each offset belongs to; without it, offsets are the N points.

        Returns:
            (B, ..., out_channels).
        """
        with full_precision(offsets):
            out = functional.linear(offsets, self.weight[:, :3], self.bias)
        if features is None:
            return out
        projected = functional.linear(features, self.weight[:, 3:])  # (B, N, out)
        return out + (projected if indices is None else gather_rows(projected, indices))


class PointMLP(nn.Module):
    """Dense layers on [coordinates; features] of points or neighbours."""

    def __init__(self, num_features: int, channels: Sequence[int]) -> None:
        super().__init__()
        self.first = PointLinear(num_features, channels[0])
        self.norm = RowBatchNorm(channels[0])
        self.rest = nn.Sequential(*[dense(a, b) for a, b in pairwise(channels)])

    def forward(
        self, offsets: Tensor, features: Tensor | None = None, indices: Tensor | None = None
    ) -> Tensor:
        """Same arguments as `PointLinear.forward`; returns (B, ..., channels[-1])."""
        rows: Tensor = self.rest(torch.relu(self.norm(self.first(offsets, features, indices))))
        return rows


class DenseMax(nn.Module):
    """Dense layer, then the maximum over the points of a neighbourhood: (B, ..., K, C) to (B, ..., C')."""

    def __init__(self, in_channels: int, out_channels: int) -> None:
        super().__init__()
        self.linear = glorot(nn.Linear(in_channels, out_channels))
        self.norm = RowBatchNorm(out_channels)

    def forward(self, rows: Tensor) -> Tensor:
        # ReLU is monotone, so it may follow the maximum, where there are K times fewer rows.
        return torch.relu(max_over(self.norm(self.linear(rows)), dim=-2))


class PooledMLP(nn.Module):
    """A small PointNet on each neighbourhood: shared dense layers, then the maximum over its points."""

    def __init__(self, num_features: int, channels: Sequence[int]) -> None:
        super().__init__()
        self.mlp = PointMLP(num_features, channels[:-1])
        self.pool = DenseMax(channels[-2], channels[-1])

    def forward(
        self, offsets: Tensor, features: Tensor | None = None, indices: Tensor | None = None
    ) -> Tensor:
        """Same arguments as `PointLinear.forward`; the axis before the last is pooled away."""
        pooled: Tensor = self.pool(self.mlp(offsets, features, indices))
        return pooled
