# SPDX-License-Identifier: Apache-2.0
"""Small PointNets: shared dense layers on coordinates and features of points, then a maximum over the points."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn import functional

from doorstate.networks.kernels.gather import gather_rows
from doorstate.networks.kernels.linear_max import linear_max
from doorstate.networks.kernels.linear_relu import linear_relu
from doorstate.networks.kernels.moments import with_moments
from doorstate.networks.kernels.precision import autocast_type, full_precision
from doorstate.networks.layers.batch_norm import RowBatchNorm
from doorstate.networks.layers.dense import Dense, glorot

_MANY_POINTS = 256  # from here on few rows have a maximum, and a gradient of those rows alone is cheaper


class PointLinear(nn.Linear):
    """Linear layer on [coordinates; features]; the coordinates keep full precision under autocast.

    W [x_j - c; f_j] = W_x (x_j - c) + W_f f_j: the second product is computed once per point, before grouping.
    """

    def __init__(self, num_features: int, out_channels: int, bias: bool = True) -> None:
        super().__init__(3 + num_features, out_channels, bias)
        glorot(self)

    def forward(
        self,
        offsets: Tensor,
        features: Tensor | None = None,
        indices: Tensor | None = None,
        folded: tuple[Tensor, Tensor | None] | None = None,
    ) -> Tensor:
        """Apply the layer to points, or to neighbours of points.

        Args:
            offsets: (B, ..., 3) coordinates, or coordinates relative to a centre.
            features: (B, N, C) features of the points, if the layer has any.
            indices: (B, ...) point of each offset; None if the offsets are those of the N points.
            folded: weight and bias to use instead of the layer's own.

        Returns:
            (B, ..., out_channels), rounded to the type of autocast at the end only.
        """
        weight, bias = folded or (self.weight, self.bias)
        dtype = autocast_type(offsets)
        with full_precision(offsets):
            outputs = functional.linear(offsets, weight[:, :3], bias).to(dtype)
        if features is None:
            return outputs
        projected = functional.linear(features, weight[:, 3:]).to(dtype)  # (B, N, out_channels)
        return outputs + (projected if indices is None else gather_rows(projected, indices))


class PointMLP(nn.Module):
    """Dense layers on [coordinates; features] of points or neighbours."""

    def __init__(self, num_features: int, channels: Sequence[int]) -> None:
        super().__init__()
        self.first = PointLinear(num_features, channels[0])
        self.norm = RowBatchNorm(channels[0])
        self.rest = nn.Sequential(*[Dense(a, b) for a, b in pairwise(channels)])

    def forward(
        self, offsets: Tensor, features: Tensor | None = None, indices: Tensor | None = None
    ) -> Tensor:
        """Return (B, ..., channels[-1]); arguments as in `PointLinear.forward`."""
        rows: Tensor = self.rest(self._first_layer(offsets, features, indices))
        return rows

    def _first_layer(self, offsets: Tensor, features: Tensor | None, indices: Tensor | None) -> Tensor:
        if not self.training:
            outputs: Tensor = self.first(offsets, features, indices, self.norm.fold(self.first))
            return outputs.relu_()
        if features is None:
            rows, mean, covariance = with_moments(offsets.flatten(0, -2))
            folded = self.norm.fold(self.first, (mean, covariance), count=len(rows))
            return linear_relu(rows, *folded).view(*offsets.shape[:-1], -1)
        outputs = self.first(offsets, features, indices, (self.first.weight, None))
        return self.norm.add_bias_and_normalize(outputs, self.first.bias).relu_()


class DenseMax(nn.Module):
    """Dense layer, then the maximum over the points of a neighbourhood."""

    def __init__(self, in_channels: int, out_channels: int) -> None:
        super().__init__()
        self.linear = glorot(nn.Linear(in_channels, out_channels))
        self.norm = RowBatchNorm(out_channels)

    def forward(self, rows: Tensor) -> Tensor:
        """Return (B, ..., out_channels) of (B, ..., K, C) points."""
        # ReLU is monotone, so it may follow the maximum, where there are K times fewer rows.
        return torch.relu(self._largest(rows))

    def _largest(self, rows: Tensor) -> Tensor:
        groups = rows.flatten(0, -3)  # (G, K, C)
        shape = (*rows.shape[:-2], -1)
        if not self.training:
            return linear_max(groups, *self.norm.fold(self.linear)).view(shape)
        if groups.shape[1] < _MANY_POINTS:
            return self.norm.max_after_linear(self.linear, groups).view(shape)
        groups = groups.to(autocast_type(groups))
        flat, mean, covariance = with_moments(groups.flatten(0, 1))
        folded = self.norm.fold(self.linear, (mean, covariance), count=len(flat), dtype=groups.dtype)
        return linear_max(flat.view_as(groups), *folded).view(shape)


class PooledMLP(nn.Module):
    """PointNet on every neighbourhood: shared dense layers, then the maximum over the points."""

    def __init__(self, num_features: int, channels: Sequence[int]) -> None:
        super().__init__()
        self.mlp = PointMLP(num_features, channels[:-1])
        self.pool = DenseMax(channels[-2], channels[-1])

    def forward(
        self, offsets: Tensor, features: Tensor | None = None, indices: Tensor | None = None
    ) -> Tensor:
        """Return (B, ..., channels[-1]) without the axis before the last; arguments as in `PointLinear.forward`."""
        pooled: Tensor = self.pool(self.mlp(offsets, features, indices))
        return pooled
