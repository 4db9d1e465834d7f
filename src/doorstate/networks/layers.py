# SPDX-License-Identifier: Apache-2.0
"""Layers on rows: every tensor is (B, ..., C), channels last, and a point is a row."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from doorstate.networks.kernels.fused import linear_max, linear_norm_max, linear_relu, with_moments
from doorstate.networks.kernels.ops import autocast_type, full_precision, gather_rows

_MANY_POINTS = 256  # from here on most rows have no maximum, and a gradient only of those that do is cheaper


class RowBatchNorm(nn.BatchNorm1d):
    """Batch normalisation of channels over all rows of all clouds."""

    momentum: float
    running_mean: Tensor
    running_var: Tensor
    num_batches_tracked: Tensor

    def forward(self, rows: Tensor) -> Tensor:
        return super().forward(rows.reshape(-1, self.num_features)).view(rows.shape)

    def after(self, linear: nn.Linear, rows: Tensor) -> Tensor:
        """Normalised outputs of a linear layer; a bias cancels against the batch's mean, and is left out."""
        if not self.training:
            weight, bias = self.fold(linear)
            return functional.linear(rows, weight, bias)
        out = functional.linear(rows, linear.weight)
        return self(out) if linear.bias is None else self.without_bias(out, linear.bias)

    def max_after(self, linear: nn.Linear, groups: Tensor) -> Tensor:
        """(G, C') maximum over the points of (G, K, C) groups of normalised outputs of a linear layer, in training."""
        shift = self.bias + 0 * linear.bias  # as in `without_bias`
        out, mean, variance = linear_norm_max(groups, linear.weight, self.weight, shift, self.eps)
        self._follow(mean + linear.bias, variance, count=groups.shape[0] * groups.shape[1])
        return out

    def without_bias(self, rows: Tensor, bias: Tensor) -> Tensor:
        """Normalise rows that lack a bias in training; only the running mean needs it, and its gradient is zero."""
        running_mean = self.running_mean.clone()  # torch keeps it for the backward pass: it must not change
        out = functional.batch_norm(
            rows.reshape(-1, self.num_features),
            running_mean,
            self.running_var,
            self.weight,
            self.bias + 0 * bias,
            training=True,
            momentum=self.momentum,
            eps=self.eps,
        )
        with torch.no_grad():
            self.num_batches_tracked += 1
            torch.add(running_mean, bias, alpha=self.momentum, out=self.running_mean)
        return out.view(rows.shape)

    def fold(
        self,
        linear: nn.Linear,
        moments: tuple[Tensor, Tensor] | None = None,
        count: int = 0,
        kind: torch.dtype | None = None,
    ) -> tuple[Tensor, Tensor]:
        """Weight and bias of one linear layer that equals `linear` followed by this normalisation.

        The outputs of W x + b have the mean W m + b and the variance diag(W S W^T), where m and S are mean and
        covariance of x: the batch's statistics are known before any output is.

        Args:
            linear: the layer before.
            moments: (C,) mean and (C, C) covariance of the batch's inputs; None takes the running statistics.
            count: number of inputs the moments are of.
            kind: type the weight will be rounded to; the outputs' mean is then taken of rounded weights, so that it
                still cancels, however far from zero the inputs are.

        Returns:
            (C', C) and (C',), at least float32.
        """
        weight = linear.weight
        bias = torch.zeros_like(self.bias) if linear.bias is None else linear.bias
        with full_precision(weight):
            if moments is None:
                scale = self.weight * torch.rsqrt(self.running_var + self.eps)
                return weight * scale.unsqueeze(1), self.bias + scale * (bias - self.running_mean)
            variance = ((weight @ moments[1]) * weight).sum(1).clamp_min(0)
            self._follow(weight @ moments[0] + bias, variance, count)
            scaled = weight * (self.weight * torch.rsqrt(variance + self.eps)).unsqueeze(1)
            scaled = scaled if kind is None else scaled.to(kind).to(scaled.dtype)
            return scaled, self.bias - scaled @ moments[
                0
            ] + 0 * bias  # the bias cancels, its gradient is zero

    @torch.no_grad()
    def _follow(self, mean: Tensor, variance: Tensor, count: int) -> None:
        self.num_batches_tracked += 1
        self.running_mean.lerp_(mean, self.momentum)
        self.running_var.lerp_(variance * (count / (count - 1)), self.momentum)


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


class Dense(nn.Sequential):
    """Linear, batch normalisation, ReLU; the bias is kept, as in the originals."""

    def __init__(self, in_channels: int, out_channels: int) -> None:
        super().__init__(glorot(nn.Linear(in_channels, out_channels)), RowBatchNorm(out_channels), nn.ReLU())

    def forward(self, rows: Tensor) -> Tensor:
        linear, norm = cast(nn.Linear, self[0]), cast(RowBatchNorm, self[1])
        return norm.after(linear, rows).relu_()


def classification_head(in_channels: int, num_classes: int, dropout: float) -> nn.Sequential:
    """Two dense layers of 512 and 256 with dropout, then logits."""
    return nn.Sequential(
        Dense(in_channels, 512),
        nn.Dropout(dropout),
        Dense(512, 256),
        nn.Dropout(dropout),
        glorot(nn.Linear(256, num_classes)),
    )


class JoinedDense(nn.Module):
    """Dense layer on [a point's features; its cloud's features], whose second product is taken once per cloud."""

    def __init__(self, num_features: int, cloud_features: int, out_channels: int) -> None:
        super().__init__()
        self.own = glorot(nn.Linear(num_features, out_channels, bias=False))
        self.cloud = glorot(nn.Linear(cloud_features, out_channels, bias=False))
        self.norm = RowBatchNorm(out_channels)

    def forward(self, rows: Tensor, features: Tensor) -> Tensor:
        """(B, N, out_channels) of (B, N, C) rows and (B, F) features of their clouds."""
        out: Tensor = self.norm(self.own(rows) + self.cloud(features).unsqueeze(1))
        return out.relu_()


class PointHead(nn.Module):
    """Logits of every point from its own features beside its cloud's."""

    def __init__(self, num_features: int, cloud_features: int, num_classes: int) -> None:
        super().__init__()
        self.joined = JoinedDense(num_features, cloud_features, 256)
        self.rest = nn.Sequential(Dense(256, 128), glorot(nn.Linear(128, num_classes)))

    def forward(self, rows: Tensor, features: Tensor) -> Tensor:
        """(B, N, num_classes) of (B, N, C) rows and (B, F) features of their clouds."""
        logits: Tensor = self.rest(self.joined(rows, features))
        return logits


class PointLinear(nn.Linear):
    """Linear layer on [coordinates; features], whose coordinate part ignores autocast.

    W [x_j - c; f_j] = W_x (x_j - c) + W_f f_j: the feature product is taken once per point, before grouping.
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
        """Apply the layer, optionally to neighbourhoods.

        Args:
            offsets: (B, ..., 3) coordinates, or coordinates relative to a centre.
            features: (B, N, C) features of the points, if the layer has any.
            indices: (B, ...) the point each offset belongs to; without it, offsets are the N points.
            folded: weight and bias to use instead of its own.

        Returns:
            (B, ..., out_channels), rounded to the type autocast asks for only at the end.
        """
        weight, bias = folded or (self.weight, self.bias)
        kind = autocast_type(offsets)
        with full_precision(offsets):
            out = functional.linear(offsets, weight[:, :3], bias).to(kind)
        if features is None:
            return out
        projected = functional.linear(features, weight[:, 3:]).to(kind)  # (B, N, out)
        return out + (projected if indices is None else gather_rows(projected, indices))


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
        """Same arguments as `PointLinear.forward`; returns (B, ..., channels[-1])."""
        out: Tensor = self.rest(self._first(offsets, features, indices))
        return out

    def _first(self, offsets: Tensor, features: Tensor | None, indices: Tensor | None) -> Tensor:
        if not self.training:
            out: Tensor = self.first(offsets, features, indices, self.norm.fold(self.first))
            return out.relu_()
        if features is None:
            rows, *moments = with_moments(offsets.flatten(0, -2))
            folded = self.norm.fold(self.first, (moments[0], moments[1]), count=len(rows))
            return linear_relu(rows, *folded).view(*offsets.shape[:-1], -1)
        out = self.first(offsets, features, indices, (self.first.weight, None))
        return self.norm.without_bias(out, self.first.bias).relu_()


class DenseMax(nn.Module):
    """Dense layer, then the maximum over the points of a neighbourhood: (B, ..., K, C) to (B, ..., C')."""

    def __init__(self, in_channels: int, out_channels: int) -> None:
        super().__init__()
        self.linear = glorot(nn.Linear(in_channels, out_channels))
        self.norm = RowBatchNorm(out_channels)

    def forward(self, rows: Tensor) -> Tensor:
        # ReLU is monotone, so it may follow the maximum, where there are K times fewer rows.
        return torch.relu(self._largest(rows))

    def _largest(self, rows: Tensor) -> Tensor:
        groups = rows.flatten(0, -3)  # (G, K, C)
        shape = (*rows.shape[:-2], -1)
        if not self.training:
            return linear_max(groups, *self.norm.fold(self.linear)).view(shape)
        if groups.shape[1] < _MANY_POINTS:
            return self.norm.max_after(self.linear, groups).view(shape)
        groups = groups.to(autocast_type(groups))
        flat, *moments = with_moments(groups.flatten(0, 1))
        folded = self.norm.fold(self.linear, (moments[0], moments[1]), count=len(flat), kind=groups.dtype)
        return linear_max(flat.view_as(groups), *folded).view(shape)


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
